#include "core/odometry/point_alignment.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <limits>

#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::expect_near;
using test::level_pose;
using test::random_vector;

FeatureMap empty_map() {
  return FeatureMap({.voxel_size_m = 1.5, .max_points_per_voxel = 20, .min_spacing_m = 0.3});
}

/// Points at random, and the same ones as a lidar sees them from `T_map_lidar`.
struct Cloud {
  explicit Cloud(const Eigen::Isometry3d& T_map_lidar,
                 SemanticClass label = SemanticClass::building)
      : map(empty_map()) {
    std::mt19937 random(5);
    for (int k = 0; k < 500; ++k) {
      const Eigen::Vector3d point_map = random_vector(random, 12.0);
      map.insert({{{point_map.cast<float>(), label}}});
      features.points.push_back({(T_map_lidar.inverse() * point_map).cast<float>(), label});
    }
  }
  FeatureMap map;
  FeatureSets features;
};

/// The cost whose minimum alignment seeks: the Geman-McClure kernel of the distance to the nearest
/// point, by brute force.
double cost(const Cloud& cloud, const Eigen::Isometry3d& T_map_lidar,
            const PointAlignmentConfig& config) {
  double sum = 0.0;
  for (const FeaturePoint& point : cloud.features.points) {
    const Eigen::Vector3f at = (T_map_lidar * point.position_lidar.cast<double>()).cast<float>();
    double nearest = config.max_distance_m * config.max_distance_m;
    for (const LabelledPoint& other : cloud.map.points())
      nearest = std::min<double>(nearest, (other.position_map - at).squaredNorm());
    const double squared_kernel = config.kernel_m * config.kernel_m;
    sum += nearest / (squared_kernel + nearest);
  }
  return sum;
}

TEST(AlignPoints, FindsThePoseOfTheSamePoints) {
  const Eigen::Isometry3d T_true = level_pose(2.0, -1.0, 0.3);
  const Cloud cloud(T_true);
  for (const Eigen::Isometry3d& off :
       {level_pose(0.4, 0.1, 0.0), level_pose(-0.2, 0.3, 0.02), level_pose(0.0, 0.0, -0.04)}) {
    const PointAlignment found = align_points(cloud.features, cloud.map, T_true * off);
    EXPECT_TRUE(found.converged);
    EXPECT_GT(found.matched, 450);
    EXPECT_GT(found.fit, 0.95);
    expect_near(found.T_map_lidar, T_true, 0.01, 0.001);
  }
}

TEST(AlignPoints, EndsWhereTheCostIsLeast) {
  Cloud cloud(level_pose(0.0, 0.0, 0.0));
  std::mt19937 random(8);
  for (FeaturePoint& point : cloud.features.points)
    point.position_lidar += random_vector(random, 0.1).cast<float>();
  PointAlignmentConfig config;
  config.step_translation_m = 1e-5;
  config.step_rotation_rad = 1e-6;
  const PointAlignment found =
      align_points(cloud.features, cloud.map, level_pose(0.1, 0.0, 0.0), {}, config);
  const double least = cost(cloud, found.T_map_lidar, config);
  for (int axis = 0; axis < 6; ++axis)
    for (const double step : {-0.02, 0.02}) {
      PoseTangent off = PoseTangent::Zero();
      off[axis] = axis < 3 ? step : 0.1 * step;
      EXPECT_GT(cost(cloud, boxplus(found.T_map_lidar, off), config), least) << "axis " << axis;
    }
}

TEST(AlignPoints, OnLevelGroundOnlyTheHeightCounts) {
  Cloud cloud(Eigen::Isometry3d::Identity());
  // Rings on the ground go along with the lidar, which has driven 0.3 m and sunk by 0.1 m.
  for (int k = 0; k < 400; ++k) {
    const float angle = 0.1F * static_cast<float>(k);
    const Eigen::Vector3f ring(8.0F * std::cos(angle), 8.0F * std::sin(angle), -1.7F);
    cloud.map.insert({{{ring, SemanticClass::road}}});
    cloud.features.level_points.push_back({ring, SemanticClass::road});
  }
  const Eigen::Isometry3d T_true(Eigen::Translation3d(0.3, 0.0, 0.0));
  for (FeaturePoint& point : cloud.features.points)
    point.position_lidar = (T_true.inverse() * point.position_lidar.cast<double>()).cast<float>();
  const PointAlignment found =
      align_points(cloud.features, cloud.map, Eigen::Isometry3d::Identity());
  expect_near(found.T_map_lidar, T_true, 0.02, 0.002);
}

TEST(AlignPoints, WithoutMovableOnesWhatDrivesAlongIsNoWitness) {
  const Eigen::Isometry3d T_true(Eigen::Translation3d(0.4, 0.0, 0.0));
  Cloud cloud(T_true);
  std::mt19937 random(6);
  for (int k = 0; k < 2000; ++k) {
    const Eigen::Vector3f point = random_vector(random, 12.0).cast<float>();
    cloud.map.insert({{{point, SemanticClass::car}}});
    cloud.features.points.push_back({point, SemanticClass::car});
  }
  const PointAlignment all = align_points(cloud.features, cloud.map, Eigen::Isometry3d::Identity());
  EXPECT_LT(all.T_map_lidar.translation().x(), 0.1);
  // The cars in the map are neighbours like others: only nearly there.
  const PointAlignment fixed =
      align_points(cloud.features, cloud.map, T_true * level_pose(0.05, 0.0, 0.0), {},
                   {.without_movable = true});
  expect_near(fixed.T_map_lidar, T_true, 0.1, 0.01);
}

TEST(AlignPoints, StaysWhereNothingIsKnown) {
  const Eigen::Isometry3d T = level_pose(3.0, 1.0, 0.2);
  const Cloud cloud(T);
  expect_near(align_points(cloud.features, empty_map(), T).T_map_lidar, T, 0.0, 1e-9);
  expect_near(align_points(FeatureSets{}, cloud.map, T).T_map_lidar, T, 0.0, 1e-9);
  Cloud broken(T);
  broken.features.points[7].position_lidar.x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_TRUE(align_points(broken.features, broken.map, T).T_map_lidar.matrix().allFinite());
}

TEST(AlignPoints, IsTheSameOnOneThreadAndOnTwo) {
  const Cloud cloud(level_pose(0.0, 0.0, 0.0));
  const auto on = [&](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    return align_points(cloud.features, cloud.map, level_pose(0.3, 0.0, 0.01)).T_map_lidar;
  };
  EXPECT_EQ(on(1).matrix(), on(2).matrix());
}

}  // namespace
}  // namespace stillmap
