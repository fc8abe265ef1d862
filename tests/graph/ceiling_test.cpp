#include "core/graph/ceiling.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <utility>
#include <vector>

namespace stillmap {
namespace {

/// Heights of what is above the ground at a place [m].
using Above = std::function<std::vector<float>(float x_m, float y_m)>;

/// Ground of 20 m by 20 m, at this height, and what is above it.
PlacedSubmap submap_of(float ground_m, const Above& above) {
  Submap submap;
  for (float x = -9.875F; x < 10.0F; x += 0.25F) {
    for (float y = -9.875F; y < 10.0F; y += 0.25F) {
      submap.points_submap.emplace_back(x, y, ground_m);
      for (const float above_m : above(x, y))
        submap.points_submap.emplace_back(x, y, ground_m + above_m);
    }
  }
  submap.classes.assign(submap.points_submap.size(), SemanticClass::unlabeled);
  return PlacedSubmap(std::move(submap));
}

std::optional<double> ceiling_of(const PlacedSubmap& lower) {
  const PlacedSubmap upper = submap_of(2.6F, [](float, float) { return std::vector<float>{}; });
  return ceiling_height_m(lower, upper, Eigen::Isometry2d::Identity());
}

TEST(Ceiling, IsWhatCoversTheGround) {
  const auto over = [](float x_m, float) { return std::vector<float>{x_m < 0.0F ? 2.3F : 2.35F}; };
  const auto height_m = ceiling_of(submap_of(-1.8F, over));
  ASSERT_TRUE(height_m);
  EXPECT_NEAR(*height_m, 2.33, 0.05);
}

TEST(Ceiling, IsKnownByTheFewStripesThatALidarSeesThatHardlyLooksUp) {
  const auto over = [](float x_m, float) {
    return x_m > 8.5F && x_m < 9.5F ? std::vector<float>{2.35F} : std::vector<float>{};
  };
  const auto height_m = ceiling_of(submap_of(-1.8F, over));
  ASSERT_TRUE(height_m);
  EXPECT_NEAR(*height_m, 2.35, 0.01);
}

TEST(Ceiling, IsNoSkyNorWallsCarsAndBranches) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<float> height_m(2.0F, 8.0F);
  const auto sky = [](float, float) { return std::vector<float>{}; };
  const auto walls = [](float, float) { return std::vector<float>{0.7F, 1.2F, 1.7F, 2.2F}; };
  const auto cars = [](float, float) { return std::vector<float>{1.4F}; };
  const auto branches = [&](float, float) { return std::vector<float>{height_m(random)}; };
  // Of a crown, what a lidar sees of it whose highest beam is level.
  std::uniform_real_distribution<float> low_m(1.85F, 3.2F);
  const auto crowns = [&](float, float) { return std::vector<float>{low_m(random)}; };
  for (const Above& above : {Above(sky), Above(walls), Above(cars), Above(branches), Above(crowns)})
    EXPECT_FALSE(ceiling_of(submap_of(0.0F, above)));
}

TEST(Ceiling, SaysNothingWhereTheOtherSawNothing) {
  const PlacedSubmap lower =
      submap_of(0.0F, [](float, float) { return std::vector<float>{2.35F}; });
  Eigen::Isometry2d T_upper_lower = Eigen::Isometry2d::Identity();
  T_upper_lower.translation().x() = 30.0;
  EXPECT_FALSE(ceiling_height_m(lower, lower, T_upper_lower));
}

/// Under it, on a street between houses of 8 m.
TEST(Ceiling, IsMissedByWhoDroveOnAnotherLevel) {
  const auto street = [](std::vector<float> over) {
    return submap_of(
               -1.8F,
               [over](float, float y_m) {
                 return std::abs(y_m) > 9.0F ? std::vector<float>{2.0F, 4.0F, 6.0F, 8.0F} : over;
               })
        .submap;
  };
  const auto no_houses = submap_of(-1.8F, [](float, float) { return std::vector<float>{}; }).submap;
  const Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  const Submap roofed = street({4.7F});
  EXPECT_TRUE(lacks_ceiling(street({}), roofed, T));
  EXPECT_FALSE(lacks_ceiling(roofed, roofed, T));
  EXPECT_FALSE(lacks_ceiling(roofed, street({}), T));
  // Nor is it, where the lidar does not look up so steeply that it must have seen it.
  const Submap low_view = [&] {
    Submap seen = street({});
    std::erase_if(seen.points_submap, [](const Eigen::Vector3f& p) {
      return p.z() > 0.15F * std::hypot(std::abs(p.x()) + 12.5F, p.y());
    });
    seen.classes.resize(seen.points_submap.size());
    return seen;
  }();
  EXPECT_FALSE(lacks_ceiling(low_view, roofed, T));
  // A lidar that does not look up shows no ceiling anywhere.
  EXPECT_FALSE(lacks_ceiling(no_houses, roofed, T));
  // Nor one that drives by.
  EXPECT_FALSE(lacks_ceiling(street({}), roofed, T * Eigen::Translation3d(0.0, 25.0, 0.0)));
}

}  // namespace
}  // namespace stillmap
