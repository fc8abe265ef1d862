#include "idl/conversions/to_cloud.hpp"

#include <cassert>
#include <limits>
#include <optional>
#include <vector>

#include "core/map/voxel_grid.hpp"
#include "idl/conversions/point_cloud2_builder.hpp"

namespace stillmap::wire {
namespace {

struct PositionOffsets {
  std::uint32_t x, y, z;
};

PositionOffsets add_position(PointCloud2Builder& builder) {
  // In this order: add_field counts the offset up.
  const auto x = builder.add_field("x", FieldType::float32);
  const auto y = builder.add_field("y", FieldType::float32);
  const auto z = builder.add_field("z", FieldType::float32);
  return {.x = x, .y = y, .z = z};
}

void fill_position(PointCloud2Builder& builder, const PositionOffsets& at, const Scan& scan) {
  builder.fill(at.x, [&](std::size_t i) { return scan.points_lidar[i].x(); });
  builder.fill(at.y, [&](std::size_t i) { return scan.points_lidar[i].y(); });
  builder.fill(at.z, [&](std::size_t i) { return scan.points_lidar[i].z(); });
}

std::optional<std::uint32_t> add_if(PointCloud2Builder& builder, bool present, const char* name,
                                    FieldType type) {
  if (!present) return std::nullopt;
  return builder.add_field(name, type);
}

std::vector<Voxel> voxels_in(const MapSnapshot& view, const Eigen::AlignedBox2f& window_map) {
  std::vector<Voxel> inside;
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  const Eigen::Vector2d low = window_map.min().cast<double>();
  const Eigen::Vector2d high = window_map.max().cast<double>();
  for (const auto& tile : tiles_in_box(view, {Eigen::Vector3d(low.x(), low.y(), -everywhere),
                                              Eigen::Vector3d(high.x(), high.y(), everywhere)})) {
    for (const Voxel& voxel : tile->voxels) {
      if (window_map.contains(voxel.mean_map.head<2>())) inside.push_back(voxel);
    }
  }
  return inside;
}

}  // namespace

sensor_msgs::msg::PointCloud2 to_cloud(const Scan& scan, std::span<const std::uint32_t> raw_labels,
                                       const std::string& lidar_frame) {
  assert(raw_labels.empty() || raw_labels.size() == scan.size());
  const bool labelled = !raw_labels.empty() || !scan.labels.empty();
  PointCloud2Builder builder(scan.stamp_ns, lidar_frame);
  const auto position = add_position(builder);
  const auto intensity = add_if(builder, !scan.intensity.empty(), "intensity", FieldType::float32);
  const auto time = add_if(builder, !scan.time_offset_s.empty(), "time", FieldType::float32);
  const auto label = add_if(builder, labelled, "label", FieldType::uint32);
  const auto ring = add_if(builder, !scan.ring.empty(), "ring", FieldType::uint16);
  builder.resize(scan.size());
  fill_position(builder, position, scan);
  if (intensity) builder.fill(*intensity, [&](std::size_t i) { return scan.intensity[i]; });
  if (time) builder.fill(*time, [&](std::size_t i) { return scan.time_offset_s[i]; });
  if (ring) builder.fill(*ring, [&](std::size_t i) { return scan.ring[i]; });
  if (label) {
    builder.fill(*label, [&](std::size_t i) {
      return raw_labels.empty() ? std::uint32_t{semantic_kitti_id(scan.labels[i])} : raw_labels[i];
    });
  }
  return builder.take();
}

sensor_msgs::msg::PointCloud2 to_cloud(const LabelledScan& labelled,
                                       const std::string& lidar_frame) {
  const Scan& scan = labelled.scan;
  PointCloud2Builder builder(scan.stamp_ns, lidar_frame);
  const auto position = add_position(builder);
  const auto intensity = builder.add_field("intensity", FieldType::float32);
  const auto rgb = builder.add_field("rgb", FieldType::float32);
  const auto confidence = builder.add_field("confidence", FieldType::float32);
  const auto label = builder.add_field("label", FieldType::uint8);
  const auto motion = builder.add_field("motion", FieldType::uint8);
  builder.resize(scan.size());
  fill_position(builder, position, scan);
  builder.fill(intensity,
               [&](std::size_t i) { return scan.intensity.empty() ? 0.0F : scan.intensity[i]; });
  builder.fill(rgb, [&](std::size_t i) { return packed_colour(labelled.label(i)); });
  builder.fill(confidence, [&](std::size_t i) {
    return labelled.labels.empty() ? 0.0F : labelled.labels.confidence[i];
  });
  builder.fill(label, [&](std::size_t i) { return static_cast<std::uint8_t>(labelled.label(i)); });
  builder.fill(motion,
               [&](std::size_t i) { return static_cast<std::uint8_t>(labelled.motion[i]); });
  builder.set_dense();
  return builder.take();
}

sensor_msgs::msg::PointCloud2 to_cloud(const MapSnapshot& view,
                                       const Eigen::AlignedBox2f& window_map, std::int64_t stamp_ns,
                                       const std::string& map_frame) {
  const auto voxels = voxels_in(view, window_map);
  PointCloud2Builder builder(stamp_ns, map_frame);
  const auto x = builder.add_field("x", FieldType::float32);
  const auto y = builder.add_field("y", FieldType::float32);
  const auto z = builder.add_field("z", FieldType::float32);
  const auto rgb = builder.add_field("rgb", FieldType::float32);
  const auto confidence = builder.add_field("confidence", FieldType::float32);
  const auto label = builder.add_field("label", FieldType::uint8);
  builder.resize(voxels.size());
  builder.fill(x, [&](std::size_t i) { return voxels[i].mean_map.x(); });
  builder.fill(y, [&](std::size_t i) { return voxels[i].mean_map.y(); });
  builder.fill(z, [&](std::size_t i) { return voxels[i].mean_map.z(); });
  builder.fill(rgb, [&](std::size_t i) { return packed_colour(voxels[i].evidence.winner()); });
  builder.fill(confidence, [&](std::size_t i) { return voxels[i].evidence.share(); });
  builder.fill(
      label, [&](std::size_t i) { return static_cast<std::uint8_t>(voxels[i].evidence.winner()); });
  builder.set_dense();
  return builder.take();
}

}  // namespace stillmap::wire
