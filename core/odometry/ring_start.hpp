#pragma once

#include <deque>
#include <span>
#include <vector>

#include "core/odometry/pose_search.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// The first scans of a lidar of few rings. One scan is all rings: where little stands up, the
/// surfaces of the next come to lie on the same rings, wherever the lidar has gone. So the first
/// scans are registered by their rings' edges and planes, and those after them by surfaces, in a
/// map of several positions.
class RingStart {
 public:
  /// A scan that was registered by edges and planes: what of its surfaces would be registered, and
  /// what enters the map. Those from where the one before was tell nothing new.
  void add(FeatureSets registered, FeatureSets mapped, const Eigen::Isometry3d& T_map_lidar);
  void clear() { scans_.clear(); }
  /// Points around the lidar of a map made earlier, which the map of surfaces has, too.
  void set_prior_map(std::span<const LabelledPoint> points_map);

  /// Whether there are scans from enough positions.
  [[nodiscard]] bool is_complete() const;

  struct BySurfaces {
    LocalMap map;
    /// Of how each scan lay on those before it.
    FitStatistics fits;
  };
  /// The scans' surfaces at their poses.
  [[nodiscard]] BySurfaces by_surfaces(const OdometryConfig& config) const;

 private:
  struct RingScan {
    FeatureSets registered;
    FeatureSets mapped;
    Eigen::Isometry3d T_map_lidar;
  };
  std::deque<RingScan> scans_;
  std::vector<LabelledPoint> prior_points_map_;
};

}  // namespace stillmap
