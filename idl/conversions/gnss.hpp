#pragma once

#include <optional>
#include <string>

#include "core/geodesy/gnss_fix.hpp"
#include "sensor_msgs.h"

namespace stillmap::wire {

/// What a NavSatFix says.
struct ReceivedFix {
  /// Nothing where the receiver has no fix, or none that can be used.
  std::optional<GnssFix> fix;
  /// Why not; empty where it merely has none.
  std::string fault;
};

/// A covariance that is not known is taken for 3 m east and north, and 6 m up.
[[nodiscard]] ReceivedFix from_nav_sat_fix(const sensor_msgs::msg::NavSatFix& message);

[[nodiscard]] sensor_msgs::msg::NavSatFix to_nav_sat_fix(const GnssFix& fix,
                                                         const std::string& antenna_frame);

}  // namespace stillmap::wire
