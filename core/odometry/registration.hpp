#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "core/odometry/correspondence.hpp"
#include "core/odometry/feature_map.hpp"
#include "core/odometry/odometry_state.hpp"

namespace stillmap {

/// A feature point as registration takes it.
struct FeaturePoint {
  /// In the lidar's frame at the middle of the sweep, as far as the motion is known.
  Eigen::Vector3f position_lidar;
  SemanticClass label = SemanticClass::unlabeled;
  /// Probability of the label: that share of an inconsistency counts, eq. (10).
  float confidence = 1.0F;
  /// When the point was measured: -0.5 at the sweep's start, 0.5 at its end; 0 where unknown.
  float sweep_part = 0.0F;
  /// On level ground, as far as its scan tells.
  bool is_level = false;
  /// Along its surface, as its ring tells, of length 1 in the lidar's frame; zero where unknown.
  Eigen::Vector3f tangent_lidar = Eigen::Vector3f::Zero();
};

/// What the motion within a sweep is expected to be: the motion since the last pose, scaled to the
/// sweep's duration. Without it a wrong motion that warps every scan alike would confirm itself.
struct SweepPrior {
  Eigen::Isometry3d T_map_lidar_last = Eigen::Isometry3d::Identity();
  /// Duration of the sweep over the time since the last pose; 0: nothing is known.
  double duration_share = 0.0;
  /// Motion that the points were compensated for (translation, rotation of the whole sweep).
  PoseTangent compensated = PoseTangent::Zero();
  /// The rotation that the points were compensated for was measured.
  bool rotation_is_measured = false;
};

/// The point of a lidar that moves by `motion` during its sweep, at the middle of the sweep; to
/// second order: a tenth of a millimetre at 20 m for 2 degrees.
[[nodiscard]] Eigen::Vector3d compensated(const Eigen::Vector3d& point_lidar, double sweep_part,
                                          const SweepCorrection& motion);

struct FeatureSets {
  std::vector<FeaturePoint> edges;
  std::vector<FeaturePoint> planes;
  /// Points that may lie on a line or a plane, as the local map says.
  std::vector<FeaturePoint> surfaces;
  /// Points of any kind and class, for the alignment of points: on something that stands up, and
  /// on level ground.
  std::vector<FeaturePoint> points;
  std::vector<FeaturePoint> level_points;
  /// The points were measured one after the other: their motion within the sweep is estimated too.
  bool rolling = false;
  SweepPrior sweep_prior;
  /// The local map's points lie along beams so far apart that
  /// `RegistrationConfig::sparse_ring_neighbours` make a surface.
  bool sparse_rings = false;
  /// Which share of the directions where the scan shows something has something opposite, 0..1: all
  /// of a lidar that looks all round, or has no rings, none of one whose rings look ahead.
  double balance = 1.0;
};

/// The local map's feature sets M_e and M_p, and points of any kind for the alignment of points.
struct LocalMap {
  explicit LocalMap(const LocalMapConfig& config);

  void clear();

  FeatureMap edges;
  FeatureMap planes;
  FeatureMap points;
};

/// A prediction that nothing confirmed.
[[nodiscard]] OdometryResult lost_at(const Eigen::Isometry3d& T_map_lidar_predicted);

/// Minimises eq. (13) as it is meant: the sum of w d^2 over edge and plane correspondences, with w
/// of eq. (10) frozen in each step of Gauss-Newton. Starts at `T_map_lidar_predicted` and returns
/// it with health `lost` when the scan gives too few correspondences. Directions that the scan
/// does not observe keep the prediction (health `degenerate`).
[[nodiscard]] OdometryResult register_features(const FeatureSets& features, const LocalMap& map,
                                               const Eigen::Isometry3d& T_map_lidar_predicted,
                                               const OdometryConfig& config,
                                               const SweepCorrection& sweep_correction = {});

/// How well a scan lies on the map at a pose that is not moved, 0..1: OdometryResult::fit by those
/// distances alone that count, each feature by what it counts (FittedSurface::weights). Rings on
/// level ground lie well wherever the lidar is, and leave it as it is.
[[nodiscard]] double counted_fit(const FeatureSets& features, const LocalMap& map,
                                 const Eigen::Isometry3d& T_map_lidar, const OdometryConfig& config,
                                 const SweepCorrection& sweep_correction = {});

/// The same as register_features in two stages: to convergence with weight 1 and no kernel, which
/// would throw away exactly the residuals that a bad prediction makes, then to convergence with the
/// weights.
[[nodiscard]] OdometryResult register_in_two_stages(const FeatureSets& features,
                                                    const LocalMap& map,
                                                    const Eigen::Isometry3d& T_map_lidar_predicted,
                                                    const OdometryConfig& config);

/// Configuration of a registration that needs no prediction: it finds motions of up to 3 m (30 m/s
/// at 10 scans a second). A robust kernel replaces eq. (10), which has no weight for residuals
/// above 1 m.
[[nodiscard]] OdometryConfig coarse_registration_config(OdometryConfig config);

/// An empty map for the coarse registration, with voxels as large as the motions that it finds.
[[nodiscard]] LocalMap make_coarse_map();

}  // namespace stillmap
