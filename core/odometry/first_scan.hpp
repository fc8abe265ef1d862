#pragma once

#include <optional>

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

/// The scan after it.
struct SecondScan {
  /// Not compensated for motion.
  const FeatureSets& features;
  const SweepTimes& sweep;
  /// So long after the first one.
  double interval_s;
};

/// What was found while the first scan was taken to be straight.
struct BentScans {
  const LocalMap& map;
  Eigen::Isometry3d T_map_first;
  const OdometryResult& second;
};

/// Both scans, as a motion between them makes them.
struct StraightenedScans {
  /// Of the first scan.
  LocalMap map;
  Eigen::Isometry3d T_map_first;
  OdometryResult second;
};

/// Builds the local map anew from the first scan, compensated for the motion that the second one
/// shows, and registers that one again; the two converge together, from the motion that was found
/// or from faster ones up to `max_speed_m_s`, whichever fits best. Nothing where they do not
/// converge.
[[nodiscard]] std::optional<StraightenedScans> straighten_first_scan(const FirstScan& first,
                                                                     const SecondScan& second,
                                                                     const BentScans& found,
                                                                     const OdometryConfig& config,
                                                                     double max_speed_m_s);

}  // namespace stillmap
