#include "core/odometry/first_motion.hpp"

#include <gtest/gtest.h>

#include "core/odometry/scan_features.hpp"

namespace stillmap::test {
namespace {

/// Level ground and posts on it, seen by a lidar that has gone so far along x.
FeatureSets ground_with_posts(double way_m) {
  FeatureSets sets;
  const auto add = [&](std::vector<FeaturePoint>& points, double x, double y, double z) {
    FeaturePoint point;
    point.position_lidar = Eigen::Vector3d(x - way_m, y, z).cast<float>();
    points.push_back(point);
  };
  for (int x = -10; x <= 10; ++x)
    for (int y = -10; y <= 10; ++y) add(sets.planes, 0.5 * x, 0.5 * y, -1.0);
  for (int post = 0; post < 12; ++post)
    for (int height = 0; height < 6; ++height)
      add(sets.points, 5.0 * (post % 4) - 8.0, 7.0 * (post / 4) - 7.0, 0.6 * height);
  return sets;
}

/// What the points say of a second scan that edges and planes put `found_m` along x, and by so
/// little or much of them.
std::optional<OdometryResult> first_motion(double true_m, double found_m, double fit) {
  const OdometryConfig config;
  RegisteredScan last;
  last.features = ground_with_posts(0.0);
  LocalMap map(config.local_map);
  extend_local_map(map, last.features, last.T_map_lidar);
  OdometryResult found;
  found.T_map_lidar.translation().x() = found_m;
  found.health = OdometryHealth::good;
  found.fit = fit;
  return first_motion_by_points(found, ground_with_posts(true_m), map, last, config);
}

// As by 16 rings on an apron, where what moves alone was found again.
TEST(FirstMotion, OfALidarAtRestIsNone) {
  const auto first = first_motion(0.0, -0.4, 0.06);
  ASSERT_TRUE(first);
  EXPECT_TRUE(first->T_map_lidar.isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_EQ(first->health, OdometryHealth::degenerate);
}

TEST(FirstMotion, StaysWherePointsLieAsWell) {
  EXPECT_FALSE(first_motion(0.4, 0.4, 0.06));
  EXPECT_FALSE(first_motion(0.0, 0.02, 0.06));
}

TEST(FirstMotion, IsNotAskedWhereMostFeaturesFit) { EXPECT_FALSE(first_motion(0.0, -0.4, 0.5)); }

}  // namespace
}  // namespace stillmap::test
