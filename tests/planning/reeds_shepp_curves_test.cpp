#include "core/planning/reeds_shepp_curves.hpp"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "tests/numbers.hpp"

namespace stillmap {
namespace {

using test::pi;

std::vector<CurvePose> poses_between(const ReedsSheppCurves& curves, const PlanarPose& a,
                                     const PlanarPose& b) {
  std::vector<CurvePose> poses;
  curves.visit_between(a, b, 0.1, 2.0, [&](const CurvePose& pose) {
    poses.push_back(pose);
    return true;
  });
  return poses;
}

TEST(ReedsSheppCurves, LeadToTheEndInSmallStepsNoTighterThanTheRadius) {
  constexpr double radius_m = 5.0;
  const ReedsSheppCurves curves(radius_m);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-15.0, 15.0);
  std::uniform_real_distribution<double> heading(-pi, pi);
  for (int i = 0; i < 200; ++i) {
    const PlanarPose a{{place(random), place(random)}, heading(random)};
    const PlanarPose b{{place(random), place(random)}, heading(random)};
    const auto poses = poses_between(curves, a, b);
    ASSERT_FALSE(poses.empty());
    EXPECT_EQ(poses.back().pose.position_map, b.position_map);
    double sum_m = 0.0;
    PlanarPose last = a;
    for (const CurvePose& at : poses) {
      const Eigen::Vector2d moved = at.pose.position_map - last.position_map;
      const double turned = std::remainder(at.pose.heading_rad - last.heading_rad, 2.0 * pi);
      ASSERT_LE(at.step_m, 0.1 + 1e-9);
      ASSERT_LE(moved.norm(), at.step_m + 1e-6);
      ASSERT_LE(std::abs(turned), at.step_m / radius_m + 1e-6);
      // It moves along its heading, in the direction that it says.
      const double middle = last.heading_rad + 0.5 * turned;
      const double along = moved.dot(Eigen::Vector2d(std::cos(middle), std::sin(middle)));
      ASSERT_NEAR(along, (at.is_reverse ? -1.0 : 1.0) * moved.norm(), 1e-5);
      sum_m += at.step_m;
      last = at.pose;
    }
    EXPECT_NEAR(sum_m, curves.length_m(a, b), 1e-6);
    EXPECT_GE(sum_m, (b.position_map - a.position_map).norm() - 1e-6);
  }
}

TEST(ReedsSheppCurves, StopWhenTheVisitorSaysSo) {
  const ReedsSheppCurves curves(2.0);
  int visited = 0;
  curves.visit_between({{0, 0}, 0}, {{10, 0}, 0}, 0.1, 1.0,
                       [&](const CurvePose&) { return ++visited < 7; });
  EXPECT_EQ(visited, 7);
}

TEST(ReedsSheppCurves, FromAPoseToItselfThereIsNothingToVisit) {
  EXPECT_TRUE(poses_between(ReedsSheppCurves(2.0), {{3, 4}, 1}, {{3, 4}, 1}).empty());
}

}  // namespace
}  // namespace stillmap
