#include "idl/conversions/scan_to_cloud.hpp"

#include <cassert>
#include <optional>

#include "idl/conversions/point_cloud2_builder.hpp"

namespace stillmap::wire {
namespace {

struct PositionOffsets {
  std::uint32_t x, y, z;
};

PositionOffsets add_position(CloudColumns& columns) {
  // In this order: add_field counts the offset up.
  const auto x = columns.add_field("x", FieldType::float32);
  const auto y = columns.add_field("y", FieldType::float32);
  const auto z = columns.add_field("z", FieldType::float32);
  return {.x = x, .y = y, .z = z};
}

void fill_position(CloudColumns& columns, const PositionOffsets& at, const Scan& scan) {
  columns.fill(at.x, [&](std::size_t i) { return scan.points_lidar[i].x(); });
  columns.fill(at.y, [&](std::size_t i) { return scan.points_lidar[i].y(); });
  columns.fill(at.z, [&](std::size_t i) { return scan.points_lidar[i].z(); });
}

std::optional<std::uint32_t> add_if(CloudColumns& columns, bool present, const char* name,
                                    FieldType type) {
  if (!present) return std::nullopt;
  return columns.add_field(name, type);
}

}  // namespace

sensor_msgs::msg::PointCloud2 to_cloud(const Scan& scan, std::span<const std::uint32_t> raw_labels,
                                       const std::string& lidar_frame) {
  assert(raw_labels.empty() || raw_labels.size() == scan.size());
  const bool labelled = !raw_labels.empty() || !scan.labels.empty();
  CloudColumns columns(scan.stamp_ns, lidar_frame);
  const auto position = add_position(columns);
  const auto intensity = add_if(columns, !scan.intensity.empty(), "intensity", FieldType::float32);
  const auto time = add_if(columns, !scan.time_offset_s.empty(), "time", FieldType::float32);
  const auto label = add_if(columns, labelled, "label", FieldType::uint32);
  const auto ring = add_if(columns, !scan.ring.empty(), "ring", FieldType::uint16);
  columns.resize(scan.size());
  fill_position(columns, position, scan);
  if (intensity) columns.fill(*intensity, [&](std::size_t i) { return scan.intensity[i]; });
  if (time) columns.fill(*time, [&](std::size_t i) { return scan.time_offset_s[i]; });
  if (ring) columns.fill(*ring, [&](std::size_t i) { return scan.ring[i]; });
  if (label) {
    columns.fill(*label, [&](std::size_t i) {
      return raw_labels.empty() ? std::uint32_t{semantic_kitti_id(scan.labels[i])} : raw_labels[i];
    });
  }
  return columns.take();
}

sensor_msgs::msg::PointCloud2 to_cloud(const LabelledScan& labelled,
                                       const std::string& lidar_frame) {
  const Scan& scan = labelled.scan;
  CloudColumns columns(scan.stamp_ns, lidar_frame);
  const auto position = add_position(columns);
  const auto intensity = columns.add_field("intensity", FieldType::float32);
  const auto rgb = columns.add_field("rgb", FieldType::float32);
  const auto confidence = columns.add_field("confidence", FieldType::float32);
  const auto label = columns.add_field("label", FieldType::uint8);
  const auto motion = columns.add_field("motion", FieldType::uint8);
  columns.resize(scan.size());
  fill_position(columns, position, scan);
  columns.fill(intensity,
               [&](std::size_t i) { return scan.intensity.empty() ? 0.0F : scan.intensity[i]; });
  columns.fill(rgb, [&](std::size_t i) { return packed_colour(labelled.label(i)); });
  columns.fill(confidence, [&](std::size_t i) {
    return labelled.labels.empty() ? 0.0F : labelled.labels.confidence[i];
  });
  columns.fill(label, [&](std::size_t i) { return static_cast<std::uint8_t>(labelled.label(i)); });
  columns.fill(motion,
               [&](std::size_t i) { return static_cast<std::uint8_t>(labelled.motion[i]); });
  columns.set_dense();
  return columns.take();
}

}  // namespace stillmap::wire
