#include "core/odometry/faint_shifts.hpp"

#include <gtest/gtest.h>

#include <random>
#include <utility>

#include "core/odometry/scan_features.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

/// Points of a passage of 6 m by 4 m round the lidar, 80 m long, with noise; with so many on a wall
/// across it 20 m ahead of the map's origin, or without an end.
FeatureSets passage(double lidar_x_m, int end_points, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> along(-40.0F, end_points > 0 ? 20.0F : 40.0F);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  std::normal_distribution<float> noise(0.0F, 0.03F);
  FeatureSets sets;
  const auto add = [&](float x, float y, float z) {
    const Eigen::Vector3f p(x + noise(random), y + noise(random), z + noise(random));
    sets.surfaces.push_back(
        {.position_lidar = p - Eigen::Vector3f(static_cast<float>(lidar_x_m), 0.0F, 0.0F)});
  };
  for (int k = 0; k < 800; ++k) {
    add(along(random), k % 2 == 0 ? 3.0F : -3.0F, 2.0F * unit(random));
    add(along(random), 3.0F * unit(random), k % 2 == 0 ? 2.0F : -2.0F);
    if (k < end_points) add(20.0F, 3.0F * unit(random), 2.0F * unit(random));
  }
  return sets;
}

LocalMap map_of(int end_points) {
  LocalMap map{LocalMapConfig{}};
  for (unsigned seed = 1; seed <= 10; ++seed) {
    FeatureSets sets;
    sets.planes = passage(0.0, end_points, seed).surfaces;
    extend_local_map(map, sets, Eigen::Isometry3d::Identity(), {});
  }
  return map;
}

OdometryResult registered(const FeatureSets& features, const LocalMap& map,
                          const OdometryConfig& config) {
  OdometryResult found = register_features(features, map, test::level_pose(1.0, 0.0, 0.0), config);
  // The noise of normals may be more or less than looks like a view.
  if (found.health == OdometryHealth::degenerate) found.health = OdometryHealth::good;
  return found;
}

TEST(FaintShifts, APassageWithoutAnEndIsDegenerateHoweverItsNormalsLean) {
  const LocalMap map = map_of(/*end_points=*/0);
  const FeatureSets features = passage(1.0, /*end_points=*/0, 77);
  const OdometryConfig config;
  const OdometryResult found = registered(features, map, config);
  ASSERT_EQ(found.health, OdometryHealth::good);
  const OdometryResult doubted = doubted_where_shift_fits(found, features, map, config);
  EXPECT_EQ(doubted.health, OdometryHealth::degenerate);
  EXPECT_TRUE(doubted.T_map_lidar.isApprox(found.T_map_lidar)) << "it is not moved";
  EXPECT_NEAR(doubted.covariance(0, 0), 1.0, 0.05);
  EXPECT_LT(doubted.covariance(1, 1), 0.01);
}

TEST(FaintShifts, AWallAcrossItShowsTheWay) {
  const LocalMap map = map_of(/*end_points=*/100);
  const FeatureSets features = passage(1.0, /*end_points=*/100, 77);
  const OdometryConfig config;
  const OdometryResult found = registered(features, map, config);
  EXPECT_NEAR(found.T_map_lidar.translation().x(), 1.0, 0.02);
  EXPECT_EQ(doubted_where_shift_fits(found, features, map, config).health, OdometryHealth::good);
}

TEST(FaintShifts, AWayThatThePredictionMissesByMoreThanTheKernelIsFound) {
  const LocalMap map = map_of(/*end_points=*/40);
  const FeatureSets features = passage(1.0, /*end_points=*/40, 77);
  const OdometryConfig config;
  const Eigen::Isometry3d T_predicted = test::level_pose(1.25, 0.0, 0.0);
  const OdometryResult direct = register_features(features, map, T_predicted, config);
  ASSERT_GT(direct.T_map_lidar.translation().x(), 1.15) << "what shows the way is left out";
  const OdometryResult found = register_with_faint_shifts(features, map, T_predicted, config);
  EXPECT_NEAR(found.T_map_lidar.translation().x(), 1.0, 0.05);
}

TEST(FaintShifts, WhatThePointsDenyIsNotFollowed) {
  LocalMap map = map_of(/*end_points=*/40);
  FeatureSets features = passage(1.0, /*end_points=*/40, 77);
  FeatureSets posts;
  for (int k = 0; k < 60; ++k)
    posts.points.push_back(
        {.position_lidar = Eigen::Vector3f(static_cast<float>(k) - 30.0F, k % 2 == 0 ? 2.0F : -2.0F,
                                           0.1F * static_cast<float>(k % 7))});
  extend_local_map(map, posts, Eigen::Isometry3d::Identity(), {});
  const OdometryConfig config;
  const Eigen::Isometry3d T_predicted = test::level_pose(1.25, 0.0, 0.0);
  const auto posts_seen_from = [&](float x_m) {
    features.points = posts.points;
    for (FeaturePoint& point : features.points) point.position_lidar.x() -= x_m;
  };
  posts_seen_from(1.0F);
  const OdometryResult found = register_with_faint_shifts(features, map, T_predicted, config);
  EXPECT_NEAR(found.T_map_lidar.translation().x(), 1.0, 0.05);
  posts_seen_from(1.25F);
  const OdometryResult denied = register_with_faint_shifts(features, map, T_predicted, config);
  EXPECT_GT(denied.T_map_lidar.translation().x(), 1.15);
}

TEST(FaintShifts, PlanesOfSingleRingsAreSoughtWithNoWiderKernel) {
  const LocalMap map = map_of(/*end_points=*/40);
  FeatureSets features = passage(1.0, /*end_points=*/40, 77);
  const OdometryConfig config;
  const Eigen::Isometry3d T_predicted = test::level_pose(1.25, 0.0, 0.0);
  std::swap(features.planes, features.surfaces);
  const OdometryResult direct = register_features(features, map, T_predicted, config);
  const OdometryResult found = register_with_faint_shifts(features, map, T_predicted, config);
  EXPECT_TRUE(found.T_map_lidar.isApprox(direct.T_map_lidar));
  EXPECT_EQ(found.iterations, direct.iterations);
}

TEST(FaintShifts, WhereNothingShowsTheWayThePredictionIsKept) {
  const LocalMap map = map_of(/*end_points=*/0);
  const FeatureSets features = passage(1.0, /*end_points=*/0, 77);
  const Eigen::Isometry3d T_predicted = test::level_pose(1.25, 0.0, 0.0);
  const OdometryResult found =
      register_with_faint_shifts(features, map, T_predicted, OdometryConfig{});
  EXPECT_NEAR(found.T_map_lidar.translation().x(), 1.25, 0.1);
}

TEST(FaintShifts, ThePapersMethodAndWhatIsLostStayAsTheyAre) {
  const LocalMap map = map_of(/*end_points=*/0);
  const FeatureSets features = passage(1.0, /*end_points=*/0, 77);
  OdometryConfig paper;
  paper.paper_exact = true;
  const OdometryResult found = registered(features, map, paper);
  EXPECT_EQ(doubted_where_shift_fits(found, features, map, paper).health, OdometryHealth::good);
  const OdometryResult lost = lost_at(found.T_map_lidar);
  EXPECT_EQ(doubted_where_shift_fits(lost, features, map, OdometryConfig{}).health,
            OdometryHealth::lost);
}

}  // namespace
}  // namespace stillmap
