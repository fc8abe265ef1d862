#include "core/geodesy/earth_alignment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace stillmap {
namespace {

const Eigen::Isometry3d T_enu_map_true =
    Eigen::Translation3d(500.0, -300.0, 12.0) * Eigen::AngleAxisd(2.5, Eigen::Vector3d::UnitZ());

/// Of a bent way, each with noise of its own.
std::vector<PointOnEarth> points_of_way(double length_m, double sigma_m, double noise_m) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  std::vector<PointOnEarth> points;
  for (double way = 0.0; way < length_m; way += 5.0) {
    PointOnEarth point;
    point.position_map = {way, 20.0 * std::sin(0.02 * way), 0.01 * way};
    point.position_enu = T_enu_map_true * point.position_map;
    for (double& axis : point.position_enu) axis += noise_m * normal(random);
    point.sigma_m = sigma_m;
    points.push_back(point);
  }
  return points;
}

double error_m(const Eigen::Isometry3d& T_enu_map, const Eigen::Vector3d& at_map) {
  return (T_enu_map * at_map - T_enu_map_true * at_map).norm();
}

TEST(EarthAlignment, IsExactWithoutNoise) {
  const auto found = align_to_earth(points_of_way(200.0, 0.02, 0.0));
  ASSERT_TRUE(found);
  EXPECT_LT((found->matrix() - T_enu_map_true.matrix()).norm(), 1e-6);
}

TEST(EarthAlignment, IsAsGoodAsTheMeanOfItsPoints) {
  const auto found = align_to_earth(points_of_way(500.0, 1.0, 1.0));
  ASSERT_TRUE(found);
  EXPECT_LT(error_m(*found, {250.0, 0.0, 0.0}), 0.5);
  EXPECT_LT(error_m(*found, {500.0, 0.0, 0.0}), 1.0);
}

// Signals by way of a house: a fifth of the fixes, far off, and to one side.
TEST(EarthAlignment, ReflectionsDoNotTurnIt) {
  auto points = points_of_way(500.0, 1.0, 0.5);
  for (std::size_t i = 0; i < points.size(); i += 5)
    points[i].position_enu += Eigen::Vector3d(30.0, 10.0, 0.0);
  const auto found = align_to_earth(points);
  ASSERT_TRUE(found);
  EXPECT_LT(error_m(*found, {0.0, 0.0, 0.0}), 1.0);
  EXPECT_LT(error_m(*found, {500.0, 0.0, 0.0}), 1.0);
}

TEST(EarthAlignment, SaysNothingOfAWayThatIsTooShort) {
  EXPECT_FALSE(align_to_earth({}));
  EXPECT_FALSE(align_to_earth(points_of_way(25.0, 0.02, 0.0))) << "too few";
  EXPECT_FALSE(align_to_earth(points_of_way(60.0, 5.0, 1.0))) << "as long as the fixes err";
  std::vector<PointOnEarth> standing(100);
  EXPECT_FALSE(align_to_earth(standing));
}

}  // namespace
}  // namespace stillmap
