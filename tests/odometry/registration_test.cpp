#include "core/odometry/registration.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <Eigen/Eigenvalues>
#include <random>

#include "core/odometry/registration_limits.hpp"
#include "core/odometry/scan_features.hpp"
#include "tests/odometry/poses.hpp"
#include "tests/odometry/surface_world.hpp"

namespace stillmap {
namespace {

using test::corridor;
using test::courtyard;
using test::expect_near;
using test::level_pose;
using test::SurfaceWorld;

const Eigen::Isometry3d T_true = level_pose(0.7, -0.4, 0.1);

PoseTangent tangent(const Eigen::Vector3d& translation, const Eigen::Vector3d& rotation) {
  PoseTangent xi;
  xi.head<3>() = translation;
  xi.tail<3>() = rotation;
  return xi;
}

OdometryConfig with_weighting(Weighting weighting) {
  OdometryConfig config;
  config.weighting = weighting;
  return config;
}

class RegisterInCourtyard : public ::testing::TestWithParam<Weighting> {
 protected:
  const SurfaceWorld world_ = courtyard();
  const LocalMap map_ = world_.local_map();
  const FeatureSets features_ = world_.features(T_true, 0.01, 1);

  void expect_converges_from(const Eigen::Isometry3d& start) const {
    const auto result = register_in_two_stages(features_, map_, start, with_weighting(GetParam()));
    EXPECT_EQ(result.health, OdometryHealth::good);
    EXPECT_TRUE(result.converged);
    EXPECT_GT(result.edge_correspondences, 20);
    EXPECT_GT(result.plane_correspondences, 500);
    EXPECT_LE(result.rms_residual_m, 0.03);
    expect_near(result.T_map_lidar, T_true, 0.01, 0.001);
  }
};

TEST_P(RegisterInCourtyard, StaysAtTheTruth) { expect_converges_from(T_true); }

TEST_P(RegisterInCourtyard, ComesFromBehindAndFromAhead) {
  for (const double ahead : {-0.4, 0.4})
    expect_converges_from(T_true * Eigen::Translation3d(ahead, 0.0, 0.0));
}

TEST_P(RegisterInCourtyard, ComesFromAnyPerturbedStart) {
  std::mt19937 random(5);
  for (int k = 0; k < 10; ++k)
    expect_converges_from(boxplus(
        T_true, tangent(test::random_vector(random, 0.25), test::random_vector(random, 0.02))));
}

TEST_P(RegisterInCourtyard, IsTheSameOnOneThreadAndOnTwo) {
  const auto result_on = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return register_features(features_, map_, level_pose(0.5, -0.3, 0.12),
                             with_weighting(GetParam()));
  };
  const OdometryResult one = result_on(1);
  const OdometryResult two = result_on(2);
  EXPECT_EQ(one.T_map_lidar.matrix(), two.T_map_lidar.matrix());
  EXPECT_EQ(one.covariance, two.covariance);
  EXPECT_EQ(one.iterations, two.iterations);
}

INSTANTIATE_TEST_SUITE_P(AllWeightings, RegisterInCourtyard,
                         ::testing::Values(Weighting::none, Weighting::geometric,
                                           Weighting::semantic));

TEST(RegisterFeatures, CorridorIsDegenerateAndKeepsThePredictionAlongIt) {
  const LocalMap map = corridor(80.0).local_map();
  const FeatureSets features = corridor(40.0).features(level_pose(0.0, 0.0, 0.0), 0.01, 2);
  const Eigen::Isometry3d predicted = level_pose(0.6, 0.2, 0.02);
  const OdometryResult result = register_features(features, map, predicted, OdometryConfig{});
  EXPECT_EQ(result.health, OdometryHealth::degenerate);
  // The noise of normals pulls a little.
  EXPECT_NEAR(result.T_map_lidar.translation().x(), 0.6, 0.1);
  EXPECT_NEAR(result.T_map_lidar.translation().y(), 0.0, 0.01);
  EXPECT_NEAR(result.T_map_lidar.translation().z(), 0.0, 0.01);
  EXPECT_LE(test::rotation_error(result.T_map_lidar, Eigen::Isometry3d::Identity()), 0.001);
  // The covariance says so too.
  EXPECT_GT(result.covariance(0, 0), 100.0 * result.covariance(1, 1));
}

TEST(RegisterFeatures, ALongAisleShowsItsRoll) {
  // Its points lie far ahead, and those that a roll moves most are 6 m beside.
  const LocalMap map = corridor(400.0).local_map();
  const FeatureSets features = corridor(360.0).features(level_pose(0.0, 0.0, 0.0), 0.01, 2);
  const Eigen::Isometry3d rolled(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitX()));
  const OdometryResult result = register_features(features, map, rolled, OdometryConfig{});
  EXPECT_LE(test::rotation_error(result.T_map_lidar, Eigen::Isometry3d::Identity()), 0.002);
}

/// Arcs on level ground round a lidar 1.7 m above it, as its rings lie.
std::vector<Eigen::Vector3f> arcs_on_ground() {
  std::vector<Eigen::Vector3f> points;
  for (const float range_m : {8.0F, 16.0F, 30.0F}) {
    for (float angle = 0.0F; angle < 6.283F; angle += 0.2F / range_m)
      points.emplace_back(range_m * std::cos(angle), range_m * std::sin(angle), -1.7F);
  }
  return points;
}

FeatureSets as_map(const std::vector<FeaturePoint>& surfaces) {
  FeatureSets sets;
  sets.planes = surfaces;
  return sets;
}

TEST(RegisterFeatures, RingsOnLevelGroundDoNotSayThatTheLidarStands) {
  LocalMap map{LocalMapConfig{}};
  FeatureSets features, level;
  for (const Eigen::Vector3f& p : arcs_on_ground()) {
    FeaturePoint point{.position_lidar = p};
    features.surfaces.push_back(point);
    point.is_level = true;
    level.surfaces.push_back(point);
  }
  extend_local_map(map, as_map(features.surfaces), Eigen::Isometry3d::Identity(), {});
  const Eigen::Isometry3d moved = level_pose(0.3, 0.0, 0.0);
  const auto x_of = [&](const FeatureSets& scan) {
    return register_features(scan, map, moved, OdometryConfig{}).T_map_lidar.translation().x();
  };
  EXPECT_NEAR(x_of(level), 0.3, 0.01);
  EXPECT_LT(x_of(features), 0.1) << "rings that may be of walls do say so";
}

/// Two smooth walls as the columns of a lidar meet them between them, farther apart the farther
/// ahead they are, and level ground.
FeatureSets columns_of_walls(const Eigen::Vector3f& tangent_lidar) {
  FeatureSets sets;
  for (const Eigen::Vector3f& p : arcs_on_ground())
    sets.surfaces.push_back({.position_lidar = p, .is_level = true});
  for (const float y : {-3.5F, 4.5F}) {
    for (float azimuth = 0.06F; azimuth < 3.08F; azimuth += 0.006F)
      for (float z = -1.5F; z < 1.0F; z += 0.2F)
        sets.surfaces.push_back({.position_lidar = {std::abs(y) / std::tan(azimuth), y, z},
                                 .tangent_lidar = tangent_lidar});
  }
  return sets;
}

TEST(RegisterFeatures, ColumnsOnSmoothWallsDoNotSayThatTheLidarStands) {
  const auto x_found = [](const FeatureSets& scan) {
    LocalMap map{LocalMapConfig{}};
    extend_local_map(map, as_map(scan.surfaces), Eigen::Isometry3d::Identity(), {});
    const Eigen::Isometry3d moved = level_pose(0.2, 0.0, 0.0);
    return register_features(scan, map, moved, OdometryConfig{}).T_map_lidar.translation().x();
  };
  EXPECT_NEAR(x_found(columns_of_walls(Eigen::Vector3f::UnitX())), 0.2, 0.02);
  EXPECT_LT(x_found(columns_of_walls(Eigen::Vector3f::Zero())), 0.1)
      << "columns that may be posts do say so";
}

TEST(LimitsFor, LinesAlongRingsCountLessTheLessIsOpposite) {
  const RegistrationConfig config;
  const auto limits = [&](double balance) {
    FeatureSets features;
    features.balance = balance;
    return limits_for(features, config);
  };
  EXPECT_EQ(limits(1.0).across_rings_weight, config.across_rings_weight);
  EXPECT_EQ(limits(0.5).across_rings_weight, config.across_rings_weight);
  EXPECT_EQ(limits(0.25).across_rings_weight, 0.5 * config.across_rings_weight);
  EXPECT_EQ(limits(0.0).across_rings_weight, 0.0);
  EXPECT_FALSE(limits(0.5).has_wide_planes);
  EXPECT_TRUE(limits(0.25).has_wide_planes);
}

TEST(RegisterFeatures, NothingButRingsOnLevelGroundIsDegenerate) {
  LocalMap map{LocalMapConfig{}};
  FeatureSets features;
  for (const Eigen::Vector3f& p : arcs_on_ground())
    features.surfaces.push_back({.position_lidar = p, .is_level = true});
  features.sparse_rings = true;
  extend_local_map(map, as_map(features.surfaces), Eigen::Isometry3d::Identity(), {});
  const Eigen::Isometry3d moved = level_pose(0.3, 0.0, 0.0);
  const OdometryResult result = register_features(features, map, moved, OdometryConfig{});
  EXPECT_EQ(result.health, OdometryHealth::degenerate);
  EXPECT_TRUE(result.T_map_lidar.isApprox(moved, 0.05));
  EXPECT_TRUE(result.covariance.allFinite());
  EXPECT_TRUE(std::isfinite(result.rms_residual_m));
}

TEST(RegisterFeatures, WhereTheScanIsNotHeardTheCovarianceIsThatOfTheGuess) {
  const SurfaceWorld world = courtyard();
  // Of no direction, though the scan shows each of them.
  OdometryConfig deaf;
  deaf.registration.min_observability = 0.99;
  const OdometryResult result =
      register_features(world.features(T_true, 0.01, 4), world.local_map(), T_true, deaf);
  EXPECT_EQ(result.health, OdometryHealth::degenerate);
  expect_near(result.T_map_lidar, T_true, 1e-12, 1e-7);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(result.covariance(k, k), 1.0, 1e-9);
}

/// The features of a lidar whose beam goes round once while its turn of `turn_rad` a sweep swells:
/// what it has turned by beyond a steady turn is `bend_rad` times the sweep's part squared.
FeatureSets seen_in_a_swelling_turn(FeatureSets features, double turn_rad, double bend_rad) {
  for (auto* points : {&features.edges, &features.planes, &features.surfaces}) {
    for (FeaturePoint& f : *points) {
      const double part = std::atan2(f.position_lidar.y(), f.position_lidar.x()) / 2.0 / M_PI;
      const Eigen::AngleAxisd turned(part * part * bend_rad, Eigen::Vector3d::UnitZ());
      f.position_lidar = (turned.inverse() * f.position_lidar.cast<double>()).cast<float>();
      f.sweep_part = static_cast<float>(part);
    }
  }
  features.rolling = true;
  features.sweep_prior.compensated[5] = turn_rad;
  return features;
}

TEST(RegisterFeatures, ATurnThatSwellsWithinTheSweepIsNotTakenForAStepAside) {
  const SurfaceWorld world = courtyard();
  const LocalMap map = world.local_map();
  constexpr double bend_rad = 0.01;
  const FeatureSets features =
      seen_in_a_swelling_turn(world.features(T_true, 0.01, 1), 0.05, bend_rad);
  const OdometryResult found = register_features(features, map, T_true, OdometryConfig{});
  EXPECT_NEAR(found.sweep_correction.bend.z(), bend_rad, 0.2 * bend_rad);
  expect_near(found.T_map_lidar, T_true, 0.01, 0.001);

  OdometryConfig steady;
  steady.registration.sweep_bend_rad = 0.0;
  const OdometryResult as_steady = register_features(features, map, T_true, steady);
  EXPECT_NEAR(as_steady.sweep_correction.bend.norm(), 0.0, 1e-6);
  const auto off = [](const OdometryResult& result) {
    return boxminus(result.T_map_lidar, T_true).norm();
  };
  EXPECT_LT(2.0 * off(found), off(as_steady));
}

TEST(RegisterFeatures, WhatTurnsSteadilyOrWasMeasuredIsHardlyBent) {
  const SurfaceWorld world = courtyard();
  const LocalMap map = world.local_map();
  FeatureSets straight = seen_in_a_swelling_turn(world.features(T_true, 0.01, 1), 0.0, 0.0);
  const OdometryResult found = register_features(straight, map, T_true, OdometryConfig{});
  EXPECT_LT(found.sweep_correction.bend.norm(), 0.0005);

  FeatureSets measured = seen_in_a_swelling_turn(world.features(T_true, 0.01, 1), 0.05, 0.01);
  measured.sweep_prior.rotation_is_measured = true;
  const OdometryResult kept = register_features(measured, map, T_true, OdometryConfig{});
  EXPECT_LT(kept.sweep_correction.bend.norm(), 1e-6);
}

TEST(RegisterFeatures, TooFewCorrespondencesAreLostAtThePrediction) {
  const SurfaceWorld world = courtyard();
  FeatureSets few = world.features(T_true, 0.01, 3);
  few.edges.resize(20);
  few.planes.resize(20);
  const Eigen::Isometry3d predicted = level_pose(0.5, -0.3, 0.08);
  const LocalMapConfig empty;
  const auto lost = [&](const FeatureSets& features, const LocalMap& map) {
    const OdometryResult result = register_features(features, map, predicted, OdometryConfig{});
    EXPECT_EQ(result.health, OdometryHealth::lost);
    EXPECT_FALSE(result.converged);
    EXPECT_EQ(result.T_map_lidar.matrix(), predicted.matrix());
  };
  lost(few, world.local_map());
  lost(FeatureSets{}, world.local_map());
  lost(world.features(T_true, 0.01, 3), LocalMap(empty));
}

TEST(RegisterFeatures, CovarianceIsPositiveDefiniteAndGrowsWithTheNoise) {
  const SurfaceWorld world = courtyard();
  const LocalMap map = world.local_map();
  double last_trace = 0.0;
  for (const double noise_m : {0.01, 0.03, 0.09}) {
    const OdometryResult result =
        register_features(world.features(T_true, noise_m, 4), map, T_true, OdometryConfig{});
    ASSERT_EQ(result.health, OdometryHealth::good);
    const Eigen::Matrix<double, 6, 6>& covariance = result.covariance;
    EXPECT_LE((covariance - covariance.transpose()).norm(), 1e-9 * covariance.norm());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(covariance);
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.0);
    EXPECT_GT(covariance.trace(), 2.0 * last_trace);
    last_trace = covariance.trace();
  }
}

/// Fences across the corridor that the map knows, where the scan sees cars' ends that have moved
/// on by 0.3 m: a third of what tells the position along x.
struct MovedThird {
  SurfaceWorld map_world = courtyard();
  SurfaceWorld scan_world = courtyard();

  MovedThird() {
    for (const double x : {-8.0, 0.0, 8.0}) {
      const test::Patch fence{
          {x, -5.0, -1.5}, {0.0, 10.0, 0.0}, {0.0, 0.0, 3.5}, SemanticClass::fence};
      map_world.planes.push_back(fence);
      test::Patch car = fence;
      car.corner_map.x() += 0.3;
      car.label = SemanticClass::car;
      scan_world.planes.push_back(car);
    }
  }

  [[nodiscard]] double error_m(const OdometryConfig& config, float confidence = 1.0F) const {
    FeatureSets features = scan_world.features(T_true, 0.01, 6);
    for (FeaturePoint& point : features.planes) point.confidence = confidence;
    const auto result = register_features(features, map_world.local_map(), T_true, config);
    EXPECT_NE(result.health, OdometryHealth::lost);
    return test::translation_error(result.T_map_lidar, T_true);
  }
};

TEST(RegisterFeatures, SemanticsHoldAgainstAMovedThirdOfTheScene) {
  const MovedThird scene;
  // The paper's weights alone, without the robust kernel.
  OdometryConfig config = with_weighting(Weighting::none);
  config.registration.robust_scale_m = 0.0;
  const double none = scene.error_m(config);
  EXPECT_GT(none, 0.05) << "without weights the moved third pulls";
  config.weighting = Weighting::semantic;
  const double semantic = scene.error_m(config);
  EXPECT_LT(semantic, 0.6 * none);
  // As shipped.
  EXPECT_LT(scene.error_m(OdometryConfig{}), 0.5 * semantic);
}

/// Traffic without labels leaves its lower edges in the map, a hand's breadth above the road.
TEST(RegisterFeatures, WhatDroveOverTheRoadHardlyLiftsTheScan) {
  LocalMap map = courtyard().local_map();
  std::mt19937 random(31);
  std::uniform_real_distribution<float> x_m(-15.0F, 15.0F), y_m(-6.0F, 6.0F), z_m(-1.55F, -1.4F);
  for (int k = 0; k < 1000; ++k)
    map.planes.insert({{{{x_m(random), y_m(random), z_m(random)}, SemanticClass::unlabeled}}});
  OdometryConfig config;
  config.registration.plane_deviation_m = 0.0;
  const FeatureSets features = courtyard().features(T_true, 0.01, 32);
  const auto lifted_m = [&] {
    const OdometryResult found = register_features(features, map, T_true, config);
    EXPECT_EQ(found.health, OdometryHealth::good);
    return found.T_map_lidar.translation().z() - T_true.translation().z();
  };
  const double all_alike_m = lifted_m();
  config.registration.plane_deviation_m = 0.03;
  EXPECT_GT(all_alike_m, 0.005);
  EXPECT_LT(std::abs(lifted_m()), 0.5 * all_alike_m);
}

TEST(RegisterFeatures, AnInconsistentLabelCountsByItsConfidence) {
  const MovedThird scene;
  OdometryConfig config = with_weighting(Weighting::semantic);
  config.registration.robust_scale_m = 0.0;
  const double sure = scene.error_m(config, 1.0F);
  const double unsure = scene.error_m(config, 0.5F);
  const double guessed = scene.error_m(config, 0.0F);
  EXPECT_LT(1.2 * sure, unsure);
  EXPECT_LT(1.2 * unsure, guessed);
}

}  // namespace
}  // namespace stillmap
