#include "core/odometry/telling_points.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr float step_m = 0.5F;

FeaturePoint point(float x, float y, const Eigen::Vector3f& tangent) {
  return {.position_lidar = {x, y, 0.0F}, .tangent_lidar = tangent};
}

/// A smooth wall along x on which rings lie as they did before, and posts that stand where they
/// stood: the lidar has gone `gone_m` along x.
struct Wall {
  FeatureSets features;
  LocalMap map{LocalMapConfig{}};

  Wall(int posts, float gone_m, const Eigen::Vector3f& tangent) {
    std::vector<LabelledPoint> before;
    for (int k = -20; k <= 20; ++k) {
      const float x = step_m * static_cast<float>(k);
      before.push_back({{x, 3.0F, 0.0F}});
      features.points.push_back(point(x, 3.0F, tangent));
    }
    for (int k = 0; k < posts; ++k) {
      const float x = 2.0F * static_cast<float>(k);
      before.push_back({{x, -2.0F, 0.0F}});
      features.points.push_back(point(x - gone_m, -2.0F, Eigen::Vector3f::Zero()));
    }
    map.points.insert(before);
  }
  /// Of having stood still over having gone `gone_m`.
  [[nodiscard]] double gain_of_standing(double gone_m) const {
    return gain_of_telling_points(features, map.points,
                                  Eigen::Isometry3d(Eigen::Translation3d(gone_m, 0.0, 0.0)),
                                  Eigen::Isometry3d::Identity(), {});
  }
};

TEST(TellingPoints, RingsOnASmoothWallDoNotOutvoteAFewPosts) {
  const Wall wall(4, 0.3F, Eigen::Vector3f::UnitX());
  EXPECT_LT(wall.gain_of_standing(0.3), 0.9);
}

TEST(TellingPoints, WhatStandsAcrossTheWayTells) {
  const Wall wall(4, 0.0F, Eigen::Vector3f::UnitY());
  EXPECT_GT(wall.gain_of_standing(0.3), 1.1);
}

TEST(TellingPoints, NothingIsSaidWithoutTangents) {
  const Wall wall(4, 0.3F, Eigen::Vector3f::Zero());
  EXPECT_EQ(wall.gain_of_standing(0.3), 1.0);
}

TEST(TellingPoints, NothingIsSaidOfNothing) {
  const LocalMap map{LocalMapConfig{}};
  EXPECT_EQ(gain_of_telling_points({}, map.points, Eigen::Isometry3d::Identity(),
                                   Eigen::Isometry3d::Identity(), {}),
            1.0);
}

}  // namespace
}  // namespace stillmap
