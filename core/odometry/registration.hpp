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
  Eigen::Vector3f position_lidar;
  SemanticClass label = SemanticClass::unlabeled;
};

struct FeatureSets {
  std::vector<FeaturePoint> edges;
  std::vector<FeaturePoint> planes;
};

/// The local map's feature sets M_e and M_p.
struct LocalMap {
  FeatureMap edges;
  FeatureMap planes;
};

/// Minimises eq. (13) as it is meant: the sum of w d^2 over edge and plane correspondences, with w
/// of eq. (10) frozen in each step of Gauss-Newton. Starts at `T_map_lidar_predicted` and returns
/// it with health `lost` when the scan gives too few correspondences. Directions that the scan
/// does not observe keep the prediction (health `degenerate`).
[[nodiscard]] OdometryResult register_features(const FeatureSets& features, const LocalMap& map,
                                               const Eigen::Isometry3d& T_map_lidar_predicted,
                                               const OdometryConfig& config);

/// Configuration of a registration that needs no prediction: it finds motions of up to 3 m (30 m/s
/// at 10 scans a second). A robust kernel replaces eq. (10), which has no weight for residuals
/// above 1 m.
[[nodiscard]] OdometryConfig coarse_registration_config(OdometryConfig config);

/// An empty map for the coarse registration, with voxels as large as the motions that it finds.
[[nodiscard]] LocalMap make_coarse_map();

}  // namespace stillmap
