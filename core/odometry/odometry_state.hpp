#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <string>

namespace stillmap {

/// How far a pose can be trusted.
enum class OdometryHealth : std::uint8_t {
  /// First scan: there was no map to register against.
  initialised = 0,
  good = 1,
  /// Some of the motion is not observable in this scan, or nothing older confirms its place.
  degenerate = 2,
  /// Too few correspondences: the pose is the prediction.
  lost = 3,
};

/// What a pose is worth to a map: whether its scan becomes a part of it, and what becomes of the
/// scans before it that wait. Those were followed, one from the other, since a place was left in
/// doubt.
enum class MapEntry : std::uint8_t {
  /// It enters: it fits what was known before anything left the place in doubt. What waits is not
  /// where it seemed to be.
  enters,
  /// It enters, and shows that what waits is where it seemed to be: that enters before it.
  enters_with_waiting,
  /// It waits until a later scan shows where it is. Until then scans agree at most with one
  /// another.
  waits,
  /// It stays out. What waits goes on waiting.
  stays_out,
  /// It stays out, and nobody will know where that is what waits.
  stays_out_with_waiting,
};

[[nodiscard]] constexpr bool is_confirmed(MapEntry entry) {
  return entry == MapEntry::enters || entry == MapEntry::enters_with_waiting;
}

/// Motion of the lidar during a sweep beyond what its points were compensated for, along the
/// lidar's axes in its middle.
struct SweepCorrection {
  /// Translation [m] and rotation [rad] from its start to its end.
  Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
  /// Rotation [rad] that grows with the square of the sweep's part (SweepTimes::part): twice as
  /// much is what the sweep's last turning rate has more than its first, a sweep.
  Eigen::Vector3d bend = Eigen::Vector3d::Zero();
};

/// What registration says of one scan.
struct OdometryResult {
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Covariance of the pose error xi = (translation [m], rotation [rad]) in the map frame, from
  /// the normal equations of eq. (13); 1 m in directions that the scan does not observe. Of a pose
  /// that is not confirmed, with what may have happened since one was.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  OdometryHealth health = OdometryHealth::initialised;
  MapEntry map_entry = MapEntry::enters;
  /// The scan fits only where what carries the lidar cannot have come; it is lost.
  bool is_beyond_limits = false;
  bool converged = false;
  int iterations = 0;
  int edge_correspondences = 0;
  int plane_correspondences = 0;
  SweepCorrection sweep_correction = {};
  /// How well the scan lies on the local map: mean over all its features of a robust score of
  /// their distance, 0 for those without a counterpart, 1 for a perfect fit.
  double fit = 0.0;
  /// Share of the features that lie where the local map has points at all.
  double overlap = 0.0;
  /// The same as `fit`, of the features in known space alone, and without those on level planes:
  /// ground lies on ground anywhere.
  double upright_fit = 0.0;
  /// Where the alignment of plain points would move the pose that features found, along the map's
  /// axes [m].
  Eigen::Vector3d point_deviation_m = Eigen::Vector3d::Zero();
  /// Root mean square of the weighted residuals after the last iteration [m].
  double rms_residual_m = 0.0;

  /// Whether the scan is a part of the map.
  [[nodiscard]] bool is_confirmed() const { return stillmap::is_confirmed(map_entry); }
};

[[nodiscard]] constexpr const char* name(OdometryHealth health) {
  switch (health) {
    case OdometryHealth::initialised:
      return "initialised";
    case OdometryHealth::good:
      return "good";
    case OdometryHealth::degenerate:
      return "degenerate";
    case OdometryHealth::lost:
      return "lost";
  }
  return "unknown";
}

}  // namespace stillmap
