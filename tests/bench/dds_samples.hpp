#pragma once

#include <cstdint>

#include "sensor_msgs.h"
#include "stillmap_msgs.h"

namespace stillmap::bench {

/// A cloud of so many bytes, stamped now.
[[nodiscard]] sensor_msgs::msg::PointCloud2 cloud_of(std::size_t bytes);
/// Says that the run is over.
[[nodiscard]] sensor_msgs::msg::PointCloud2 last_cloud();
[[nodiscard]] bool is_last(const sensor_msgs::msg::PointCloud2& cloud);
/// Time since it was stamped, by the clock that all processes of a machine share.
[[nodiscard]] double age_ms(const sensor_msgs::msg::PointCloud2& cloud);

/// An answer of about so many bytes.
[[nodiscard]] stillmap_msgs::srv::GetStaticMap_Response map_of(std::size_t bytes);

}  // namespace stillmap::bench
