#pragma once

#include <optional>
#include <string>

#include "core/inertial/imu_sample.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {

/// Orientation and covariances are said to be unknown, as ROS 2 does it: -1 in the first element.
[[nodiscard]] sensor_msgs::msg::Imu to_imu(const ImuSample& sample, const std::string& imu_frame);

/// Nothing when the stamp cannot be used. Rates and accelerations are as they come, NaN too; the
/// orientation, which few IMUs have, is not read.
[[nodiscard]] std::optional<ImuSample> from_imu(const sensor_msgs::msg::Imu& imu);

}  // namespace stillmap::wire
