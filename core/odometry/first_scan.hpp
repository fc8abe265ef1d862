#pragma once

#include "core/lidar/prepare.hpp"
#include "core/odometry/pose_search.hpp"

namespace stillmap {

/// A first scan that rolled at an unknown velocity, until the second one tells it.
struct FirstScan {
  FeatureSets features;
  SweepTimes sweep;
  Eigen::Isometry3d T_map_stamp;
};

/// Whether a scan shows enough that the next one can be registered to it.
[[nodiscard]] bool can_begin_map(const FeatureSets& features, const OdometryConfig& config);

/// Builds the local map anew from the first scan, compensated for the motion that the second one
/// shows, and registers that one again; the two converge together, from that motion or from faster
/// ones up to `max_speed_m_s`, whichever fits best. `features` are those of the second scan, not
/// compensated, `second` its pose, `interval_s` after the first one's, `last` the first scan's. All
/// stay as they are where they do not converge.
void straighten_first_scan(const FirstScan& first, const FeatureSets& features, double interval_s,
                           const SweepTimes& sweep, const OdometryConfig& config,
                           double max_speed_m_s, LocalMap& map, RegisteredScan& last,
                           OdometryResult& second);

}  // namespace stillmap
