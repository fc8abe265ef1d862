#include "tests/bench/dds_samples.hpp"

#include <chrono>

namespace stillmap::bench {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;

std::int64_t now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

sensor_msgs::msg::PointCloud2 cloud_of(std::size_t bytes) {
  sensor_msgs::msg::PointCloud2 cloud;
  cloud.data().assign(bytes, 1);
  const std::int64_t stamp_ns = now_ns();
  cloud.header().stamp().sec(static_cast<std::int32_t>(stamp_ns / ns_per_s));
  cloud.header().stamp().nanosec(static_cast<std::uint32_t>(stamp_ns % ns_per_s));
  return cloud;
}

sensor_msgs::msg::PointCloud2 last_cloud() { return {}; }

bool is_last(const sensor_msgs::msg::PointCloud2& cloud) { return cloud.data().empty(); }

double age_ms(const sensor_msgs::msg::PointCloud2& cloud) {
  const auto& stamp = cloud.header().stamp();
  const std::int64_t stamp_ns = stamp.sec() * ns_per_s + stamp.nanosec();
  return static_cast<double>(now_ns() - stamp_ns) / 1e6;
}

stillmap_msgs::srv::GetStaticMap_Response map_of(std::size_t bytes) {
  constexpr std::size_t bytes_per_voxel = 21;
  const std::size_t voxels = bytes / bytes_per_voxel;
  stillmap_msgs::srv::GetStaticMap_Response response;
  response.voxels().x().resize(voxels);
  response.voxels().y().resize(voxels);
  response.voxels().z().resize(voxels);
  response.voxels().label().resize(voxels);
  response.voxels().confidence().resize(voxels);
  response.voxels().point_count().resize(voxels);
  return response;
}

}  // namespace stillmap::bench
