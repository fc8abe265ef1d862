#pragma once

#include <Eigen/Geometry>

#include "core/geodesy/datum.hpp"
#include "core/geodesy/gnss_fix.hpp"

namespace stillmap {

/// The frame that touches the earth at one place: x east, y north, z up [m].
class EastNorthUp {
 public:
  /// About this place. Altitudes are heights above the ellipsoid [m].
  EastNorthUp(double latitude_deg, double longitude_deg, double altitude_m)
      : latitude_deg_(latitude_deg), longitude_deg_(longitude_deg), altitude_m_(altitude_m) {}

  /// Of a fix without an altitude: where this frame's origin has it.
  [[nodiscard]] Eigen::Vector3d position_enu(const GnssFix& fix) const;
  /// The place of this point, without a covariance.
  [[nodiscard]] GnssFix fix_at(const Eigen::Vector3d& position_enu) const;

  /// Where a map lies that has this pose here. What it is tilted by is not in a datum.
  [[nodiscard]] Datum datum_of(const Eigen::Isometry3d& T_enu_map) const;
  /// A pose in this frame as a pose in the earth's own, `earth` of REP 105: origin in the earth's
  /// centre, z to the north pole, x to the meridian of Greenwich (ECEF).
  [[nodiscard]] Eigen::Isometry3d T_earth(const Eigen::Isometry3d& T_enu) const;

 private:
  double latitude_deg_;
  double longitude_deg_;
  double altitude_m_;
};

}  // namespace stillmap
