#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stillmap {

/// By what poses of a map were wrong, each at its time: what was seen then moves along. Times
/// before the first are not corrected, those after the last as that one.
class MapCorrection {
 public:
  struct Pose {
    std::int64_t stamp_ns = 0;
    /// Where the lidar was by the map until now [m].
    Eigen::Vector3d position_map = Eigen::Vector3d::Zero();
    /// The map until now, in the corrected one.
    Eigen::Isometry3d T_new_old = Eigen::Isometry3d::Identity();
  };

  /// Stamps ascend; at least one.
  explicit MapCorrection(std::vector<Pose> poses);

  [[nodiscard]] const std::vector<Pose>& poses() const { return poses_; }
  [[nodiscard]] std::int64_t begin_ns() const { return poses_.front().stamp_ns; }
  /// Null where nothing is corrected.
  [[nodiscard]] const Eigen::Isometry3d* at(std::int64_t stamp_ns) const;
  [[nodiscard]] const Eigen::Isometry3d& latest() const { return poses_.back().T_new_old; }
  /// How far a point moves that is seen within so many metres of the lidar, at most [m].
  [[nodiscard]] static double max_shift_m(const Pose& pose, double range_m);

 private:
  std::vector<Pose> poses_;
};

/// One after the other; the second is of the same time or more.
[[nodiscard]] MapCorrection combined(const MapCorrection& first, const MapCorrection& second);

/// What a correction changed in a map.
struct CorrectedMap {
  std::size_t moved_voxels = 0;
  std::size_t changed_tiles = 0;
};

}  // namespace stillmap
