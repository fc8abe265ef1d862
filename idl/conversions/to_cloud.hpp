#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <string>

#include "core/lidar/labelled_scan.hpp"
#include "core/map/tile.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {

/// The scan as a lidar driver would send it: float32 x y z [m], and where the scan has them
/// intensity (float32, 0..1), time (float32, s after the stamp), ring (uint16), label (uint32).
/// Labels are original SemanticKITTI ids: `raw_labels` (empty or as long as the scan), else those
/// that stand for the scan's classes.
[[nodiscard]] sensor_msgs::msg::PointCloud2 to_cloud(const Scan& scan,
                                                     std::span<const std::uint32_t> raw_labels,
                                                     const std::string& lidar_frame);

/// What became of a scan: x y z intensity (float32), rgb (the class's colour, packed as RViz2
/// expects it), confidence (float32), label (class 0..19) and motion (0 stationary, 1 semi-static,
/// 2 highly dynamic) as uint8.
[[nodiscard]] sensor_msgs::msg::PointCloud2 to_cloud(const LabelledScan& labelled,
                                                     const std::string& lidar_frame);

/// The voxels of the map inside the box as a cloud that RViz2 shows in class colours: x y z [m],
/// rgb (packed as RViz2 expects it), confidence (float32), label (uint8, class 0..19).
[[nodiscard]] sensor_msgs::msg::PointCloud2 to_cloud(const MapSnapshot& view,
                                                     const Eigen::AlignedBox2f& window_map,
                                                     std::int64_t stamp_ns,
                                                     const std::string& map_frame);

}  // namespace stillmap::wire
