#include "core/lidar/level_plane.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace stillmap {
namespace {

std::vector<Eigen::Vector3f> slope_with_outliers(double share_of_outliers) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> place(-8.0F, 8.0F);
  std::uniform_real_distribution<float> above(0.5F, 5.0F);
  std::bernoulli_distribution is_outlier(share_of_outliers);
  std::normal_distribution<float> noise(0.0F, 0.02F);
  std::vector<Eigen::Vector3f> points(200);
  for (Eigen::Vector3f& p : points) {
    p.x() = place(random);
    p.y() = place(random);
    p.z() = -1.7F + 0.05F * p.x() - 0.1F * p.y() + noise(random);
    if (is_outlier(random)) p.z() += above(random);
  }
  return points;
}

TEST(LevelPlane, IsFoundBelowWhatStandsOnIt) {
  const auto plane = fit_level_plane(slope_with_outliers(0.4), 0.35, 0.3);
  ASSERT_TRUE(plane);
  EXPECT_NEAR(plane->height_m, -1.7, 0.02);
  EXPECT_NEAR(plane->slope.x(), 0.05, 0.005);
  EXPECT_NEAR(plane->slope.y(), -0.1, 0.005);
  EXPECT_NEAR(plane->at({2.0, 1.0}), -1.7 + 0.1 - 0.1, 0.03);
}

TEST(LevelPlane, IsNotFoundWhereFewPointsAgreeOrAWallStands) {
  EXPECT_FALSE(fit_level_plane(slope_with_outliers(0.9), 0.35, 0.5));
  EXPECT_FALSE(fit_level_plane({}, 0.35, 0.3));
  std::vector<Eigen::Vector3f> wall;
  for (int k = 0; k < 100; ++k)
    wall.emplace_back(5.0F, 0.1F * static_cast<float>(k % 10), 0.3F * static_cast<float>(k / 10));
  EXPECT_FALSE(fit_level_plane(wall, 0.35, 0.3));
}

TEST(LevelPlane, PointsAtOnePlaceGiveNone) {
  EXPECT_FALSE(fit_level_plane(std::vector<Eigen::Vector3f>(50, {1.0F, 2.0F, 3.0F}), 0.35, 0.3));
}

}  // namespace
}  // namespace stillmap
