#include "core/graph/upright_image.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/graph/street_world.hpp"

namespace stillmap {
namespace {

TEST(UprightImage, TellsWhatStandsFromGround) {
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 20; ++i) points.emplace_back(0.5F * static_cast<float>(i), 0.0F, -1.7F);
  for (int i = 0; i < 8; ++i) points.emplace_back(3.1F, 0.1F, -1.7F + 0.3F * static_cast<float>(i));
  const UprightImage image(points);
  ASSERT_EQ(image.upright_submap().size(), 1U);
  EXPECT_LT((image.upright_submap()[0] - Eigen::Vector2f(3.25F, 0.25F)).norm(), 1e-5F);
  EXPECT_FLOAT_EQ(image.lowest_at({3.1F, 0.1F}).value(), -1.7F);
  EXPECT_FALSE(image.lowest_at({3.1F, 40.0F}).has_value());
  EXPECT_TRUE(UprightImage(std::span<const Eigen::Vector3f>()).upright_submap().empty());
}

TEST(UprightImage, CountsTheMemoryOfItsCells) {
  std::vector<Eigen::Vector3f> points{{0.0F, 0.0F, 0.0F}, {99.9F, 49.9F, 0.0F}};
  const UprightImage image(points);
  const auto cells =
      static_cast<std::size_t>(image.columns()) * static_cast<std::size_t>(image.rows());
  EXPECT_GE(cells, 200U * 100U);
  EXPECT_GE(image.bytes(), cells * 2 * sizeof(float));
  EXPECT_LE(image.bytes(), cells * 32 + 1000);
}

TEST(AlignInPlan, FindsAPlaceSeenFromTheOtherLaneBackwards) {
  const StreetWorld world(5);
  const Submap a = world.submap_at(0.0, 25.0, false, 1);
  const Submap b = world.submap_at(5.0, 30.0, true, 2);
  const Eigen::Isometry3d expected = a.T_submap_key * world.T_map_lidar_at(12.0, false).inverse() *
                                     world.T_map_lidar_at(18.0, true) * b.T_submap_key.inverse();
  Eigen::Isometry2d guess = Eigen::Isometry2d::Identity();
  guess.linear() =
      Eigen::Rotation2Dd(std::atan2(expected(1, 0), expected(0, 0)) + 0.05).toRotationMatrix();
  guess.translation() = expected.translation().head<2>() + Eigen::Vector2d(4.0, -3.0);
  const UprightImage image_a(a.points_submap), image_b(b.points_submap);
  const PlanAlignments found = align_in_plan(image_a, image_b, guess, {6.0, 0.09});
  EXPECT_LT((found.best.T_a_b.translation() - expected.translation().head<2>()).norm(), 0.8);
  EXPECT_LT(found.runner_up.score, 0.75 * found.best.score);
  EXPECT_NEAR(ground_offset_m(image_a, image_b, found.best.T_a_b).value(), 0.0, 0.1);
}

TEST(AlignInPlan, ARepeatedStreetHasARunnerUp) {
  const StreetWorld world(5, StreetWorld::length_m / 20.0);
  const Submap a = world.submap_at(0.0, 25.0, false, 1);
  const UprightImage image(a.points_submap);
  // The next house is 15.7 m along the street.
  const PlanAlignments found =
      align_in_plan(image, image, Eigen::Isometry2d::Identity(), {17.0, 0.35});
  EXPECT_GT(found.runner_up.score, 0.5 * found.best.score);
  EXPECT_GT((found.runner_up.T_a_b.translation() - found.best.T_a_b.translation()).norm(), 2.0);
}

}  // namespace
}  // namespace stillmap
