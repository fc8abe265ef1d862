#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <vector>

#include "core/graph/submap.hpp"
#include "core/graph/submap_match.hpp"
#include "core/odometry/feature_map.hpp"

namespace stillmap {

struct EarlierMapConfig {
  /// Of the map, what is this near to a submap's key is what it is registered in [m].
  double piece_radius_m = 55.0;
  DriftModel drift;
  SubmapMatchConfig match;
};

/// A map that was there before a drive, and stays where it is: submaps of the drive are looked for
/// in it.
class EarlierMap {
 public:
  /// Its voxels, means and classes, within this distance across of a place [m].
  using PointsNear = std::function<std::vector<LabelledPoint>(const Eigen::Vector2d& position_map,
                                                              double radius_m)>;

  explicit EarlierMap(PointsNear points_near, const EarlierMapConfig& config = {})
      : points_near_(std::move(points_near)), config_(config) {}

  struct Match {
    Eigen::Isometry3d T_map_key = Eigen::Isometry3d::Identity();
    /// Its jump is from where the key was expected.
    SubmapMatch match;
  };
  /// Looks for the submap round where its key is expected, `way_m` of drift from a place that is
  /// known. Nothing where the map has nothing there. Throws what the map's points throw.
  [[nodiscard]] std::optional<Match> match(const Submap& submap,
                                           const Eigen::Isometry3d& T_map_key_expected,
                                           double way_m) const;

 private:
  /// The map round a pose, in its upright frame; the key is the pose.
  [[nodiscard]] Submap piece_round(const Eigen::Isometry3d& T_map_key) const;

  PointsNear points_near_;
  EarlierMapConfig config_;
};

}  // namespace stillmap
