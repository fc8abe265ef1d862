#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>

#include "core/map/tile.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {

/// The voxels of the map inside the box as a cloud that RViz2 shows in class colours: x y z [m],
/// rgb (packed as RViz2 expects it), confidence (float32), label (uint8, class 0..19).
[[nodiscard]] sensor_msgs::msg::PointCloud2 to_cloud(const MapSnapshot& view,
                                                     const Eigen::AlignedBox2f& window_map,
                                                     std::int64_t stamp_ns,
                                                     const std::string& map_frame);

}  // namespace stillmap::wire
