#include "idl/conversions/map_to_cloud.hpp"

#include <vector>

#include "idl/conversions/point_cloud2_builder.hpp"

namespace stillmap::wire {
namespace {

std::vector<const Voxel*> voxels_in(const MapSnapshot& view,
                                    const Eigen::AlignedBox2f& window_map) {
  std::vector<const Voxel*> inside;
  for (const auto& tile : view.tiles) {
    const auto& bounds = tile->info.bounds_map;
    const Eigen::AlignedBox2f footprint(bounds.min().head<2>(), bounds.max().head<2>());
    if (!window_map.intersects(footprint)) continue;
    for (const Voxel& voxel : tile->voxels) {
      if (window_map.contains(voxel.mean_map.head<2>())) inside.push_back(&voxel);
    }
  }
  return inside;
}

}  // namespace

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
  builder.fill(x, [&](std::size_t i) { return voxels[i]->mean_map.x(); });
  builder.fill(y, [&](std::size_t i) { return voxels[i]->mean_map.y(); });
  builder.fill(z, [&](std::size_t i) { return voxels[i]->mean_map.z(); });
  builder.fill(rgb, [&](std::size_t i) { return packed_colour(voxels[i]->evidence.winner()); });
  builder.fill(confidence, [&](std::size_t i) { return voxels[i]->evidence.share(); });
  builder.fill(label, [&](std::size_t i) {
    return static_cast<std::uint8_t>(voxels[i]->evidence.winner());
  });
  builder.set_dense();
  return builder.take();
}

}  // namespace stillmap::wire
