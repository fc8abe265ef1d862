#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// How far the beams of a scan went, by direction from the lidar: what stands nearer is seen
/// through.
class DirectionRanges {
 public:
  explicit DirectionRanges(const std::vector<Eigen::Vector3f>& points_lidar);

  enum class Sight {
    /// No beam went near that direction, or something nearer hides it.
    unknown,
    /// A beam ended there.
    hit,
    /// All beams near that direction went on.
    seen_through,
  };
  /// Whether something at this place was seen.
  [[nodiscard]] Sight look_at(const Eigen::Vector3f& p_lidar) const;

 private:
  struct Ranges {
    float nearest = 0.0F;
    float farthest = 0.0F;
  };

  std::vector<Ranges> cells_;
};

/// A scan as it is looked for in a map. Its frame `upright` has the lidar's origin and the axes of
/// what carries it; `foot` is the point of the ground below, its z perpendicular to the ground.
struct LocalizationQuery {
  /// @param R_body_lidar the lidar's attitude on what carries it.
  LocalizationQuery(const Scan& scan, const PointLabels& labels,
                    const Eigen::Matrix3d& R_body_lidar);

  /// A rotation.
  Eigen::Isometry3d T_upright_lidar = Eigen::Isometry3d::Identity();
  /// For the alignment of points: on what stands up, and on level ground; and what is registered on
  /// the map's surfaces.
  FeatureSets features_upright;
  /// What stands up and cannot move by its label.
  std::vector<Eigen::Vector3f> landmarks_foot;
  Eigen::Isometry3d T_foot_upright = Eigen::Isometry3d::Identity();
  /// Otherwise `foot` is `upright`.
  bool has_ground = false;
  DirectionRanges ranges_upright;
};

}  // namespace stillmap
