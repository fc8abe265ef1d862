#include "core/traversability/surface_tile.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace stillmap {
namespace {

constexpr double cell_m = 0.2;
constexpr int middle = 10;

GroundGrid ground_of(const std::function<double(double, double)>& height_m,
                     SemanticClass label = SemanticClass::road) {
  GroundGrid ground(2 * middle + 1, 2 * middle + 1);
  for_each_cell(ground, [&](int x, int y) {
    GroundCell& cell = ground(x, y);
    cell.height_m = static_cast<float>(height_m((x - middle) * cell_m, (y - middle) * cell_m));
    cell.origin = GroundOrigin::seen;
    cell.label = label;
  });
  return ground;
}

SurfaceShape shape_in_the_middle(const GroundGrid& ground) {
  return shape_at(ground, middle, middle, cell_m);
}

TEST(SurfaceShape, APlaneHasItsSlopeAndNoStep) {
  const double degree = std::numbers::pi / 180.0;
  for (const double slope_deg : {0.0, 5.0, 20.0, 40.0}) {
    const double rise = std::tan(slope_deg * degree);
    const SurfaceShape shape = shape_in_the_middle(
        ground_of([&](double x, double y) { return rise * (0.6 * x + 0.8 * y); }));
    EXPECT_NEAR(shape.slope, slope_deg * degree, 1e-4) << slope_deg;
    EXPECT_NEAR(shape.step_m, 0.0, 1e-5) << slope_deg;
    EXPECT_NEAR(shape.roughness_m, 0.0, 1e-4) << slope_deg;
  }
}

TEST(SurfaceShape, AnEdgeIsAStepOnBothItsSides) {
  const GroundGrid ground = ground_of([](double x, double) { return x < 0.1 ? 0.0 : 0.13; });
  EXPECT_NEAR(shape_at(ground, middle, middle, cell_m).step_m, 0.13, 1e-5);
  EXPECT_NEAR(shape_at(ground, middle + 1, middle, cell_m).step_m, 0.13, 1e-5);
  EXPECT_NEAR(shape_at(ground, middle + 3, middle, cell_m).step_m, 0.0, 1e-5);
}

TEST(SurfaceShape, AnEdgeBlurredOverOneCellIsStillItsWholeStep) {
  const GroundGrid ground =
      ground_of([](double x, double) { return std::clamp((x + 0.2) / 0.4, 0.0, 1.0) * 0.13; });
  EXPECT_NEAR(shape_in_the_middle(ground).step_m, 0.13, 1e-5);
}

TEST(SurfaceShape, AnEdgeOnASlopeIsTheStepAlone) {
  const GroundGrid ground =
      ground_of([](double x, double) { return 0.2 * x + (x < 0.1 ? 0.0 : 0.13); });
  EXPECT_NEAR(shape_in_the_middle(ground).step_m, 0.13, 1e-4);
}

TEST(SurfaceShape, TheFootOfARampIsNoStep) {
  const GroundGrid ground = ground_of([](double x, double) { return x > 0.0 ? 0.25 * x : 0.0; });
  EXPECT_LT(shape_in_the_middle(ground).step_m, 0.01);
}

TEST(SurfaceShape, AKerbOfAnotherClassDoesNotTiltThePlane) {
  GroundGrid ground = ground_of([](double x, double) { return x < 0.1 ? 0.0 : 0.13; });
  for_each_cell(ground, [&](int x, int y) {
    if (x > middle) ground(x, y).label = SemanticClass::sidewalk;
  });
  EXPECT_NEAR(shape_in_the_middle(ground).slope, 0.0, 1e-6);
}

TEST(SurfaceShape, RoughnessIsTheDeviationOfTheNoise) {
  std::mt19937 random(2);
  std::normal_distribution<double> noise_m(0.0, 0.03);
  const GroundGrid ground = ground_of([&](double, double) { return noise_m(random); });
  double sum = 0.0;
  for (int x = 5; x < 15; ++x) {
    for (int y = 5; y < 15; ++y) sum += shape_at(ground, x, y, cell_m).roughness_m;
  }
  EXPECT_NEAR(sum / 100.0, 0.03, 0.005);
}

TEST(SurfaceShape, ACellAloneIsFlat) {
  GroundGrid ground(5, 5);
  ground(2, 2).origin = GroundOrigin::seen;
  EXPECT_EQ(shape_at(ground, 2, 2, cell_m), SurfaceShape{});
}

TEST(SurfaceShape, ANeighbourWithoutGroundLeavesTheOtherSide) {
  GroundGrid ground = ground_of([](double x, double) { return x < 0.1 ? 0.0 : 0.2; });
  for_each_cell(ground, [&](int x, int y) {
    if (x == middle - 1) ground(x, y) = {};
  });
  EXPECT_NEAR(shape_in_the_middle(ground).step_m, 0.2, 1e-5);
}

/// Largest step of the middle row.
double largest_step_m(const GroundGrid& ground) {
  double step_m = 0.0;
  for (int x = 4; x <= 2 * middle - 4; ++x)
    step_m = std::max(step_m, static_cast<double>(shape_at(ground, x, middle, cell_m).step_m));
  return step_m;
}

TEST(SurfaceShape, ASecondStepCloseByIsNoSlope) {
  for (const double apart_m : {0.2, 0.4, 0.6}) {
    const GroundGrid ground = ground_of([&](double x, double) {
      return (x < -0.1 ? 0.0 : 0.12) + (x < apart_m - 0.1 ? 0.0 : 0.12);
    });
    EXPECT_GT(largest_step_m(ground), 0.119) << apart_m;
  }
}

TEST(SurfaceShape, TheRestOfABlurredEdgeIsNoSlope) {
  // A kerb on a border of voxels: the noise puts parts of its face in the cells on both sides.
  const std::array<double, 4> shares{0.1, 0.4, 0.8, 1.0};
  const GroundGrid ground = ground_of([&](double x, double) {
    const auto i = std::lround(x / cell_m);
    if (i < 0) return 0.0;
    return 0.15 * (i < 4 ? shares.at(static_cast<std::size_t>(i)) : 1.0);
  });
  EXPECT_GT(largest_step_m(ground), 0.09);
}

TEST(SurfaceShape, ADropBeyondUnknownGroundIsAStepAtBothItsEnds) {
  for (const int unknown : {1, 5}) {
    for (const double rise : {0.0, -0.4}) {
      GroundGrid ground = ground_of(
          [&](double x, double) { return rise * x - (x < (unknown + 0.5) * cell_m ? 0.0 : 1.2); });
      for_each_cell(ground, [&](int x, int y) {
        if (x > middle && x <= middle + unknown) ground(x, y) = {};
      });
      EXPECT_GT(shape_in_the_middle(ground).step_m, 1.1) << unknown;
      EXPECT_GT(shape_at(ground, middle + unknown + 1, middle, cell_m).step_m, 1.1) << unknown;
    }
  }
}

TEST(SurfaceShape, AnEdgeBeyondWhichTheGroundIsSeenFromFarAwayIsAHiddenDrop) {
  // A platform of 0.55 m, and a slope of 0.2 per metre, behind 1.4 m of what was not seen.
  for (const double lower_m : {0.55, 0.28}) {
    GroundGrid ground = ground_of([&](double x, double) { return x < 1.5 ? 0.0 : -lower_m; });
    for_each_cell(ground, [&](int x, int y) {
      if (x > middle && x <= middle + 7) ground(x, y) = {};
    });
    const SurfaceShape above = shape_in_the_middle(ground);
    EXPECT_NEAR(above.step_m, 0.0, 1e-5);
    EXPECT_NEAR(above.hidden_drop_m, lower_m > 0.5 ? lower_m : 0.0, 1e-5);
    EXPECT_NEAR(shape_at(ground, middle + 8, middle, cell_m).hidden_drop_m, 0.0, 1e-5);
  }
}

TEST(SurfaceShape, ASlopeThatGoesOnBeyondUnknownGroundIsNoStep) {
  for (const double rise : {0.45, 0.55, 1.2}) {
    for (const int gap : {2, 5}) {
      GroundGrid ground = ground_of([&](double x, double) { return rise * x; });
      for_each_cell(ground, [&](int x, int y) {
        if (x > middle && x <= middle + gap) ground(x, y) = {};
      });
      EXPECT_LT(shape_in_the_middle(ground).step_m, 0.1) << rise << ", " << gap;
      EXPECT_LT(shape_in_the_middle(ground).hidden_drop_m, 0.1) << rise << ", " << gap;
    }
  }
}

TEST(SurfaceShape, ASlopeOfSingleRowsIsNoHiddenDropAndATerraceOfThemIs) {
  for (const int apart : {4, 7}) {
    const auto rows_of = [apart](const std::function<double(double, double)>& height_m) {
      GroundGrid ground = ground_of(height_m);
      for_each_cell(ground, [&](int x, int y) {
        if ((x - middle) % apart != 0) ground(x, y) = {};
      });
      return shape_in_the_middle(ground);
    };
    for (const double rise : {0.3, 0.4, -0.4}) {
      const SurfaceShape slope = rows_of([rise](double x, double) { return rise * x; });
      EXPECT_NEAR(slope.step_m, 0.0, 1e-5) << rise;
      EXPECT_NEAR(slope.hidden_drop_m, 0.0, 1e-5) << rise;
    }
    const double drop_m = 0.45 * apart * cell_m;
    const SurfaceShape platform =
        rows_of([&](double x, double) { return x > 0.1 ? -drop_m : 0.0; });
    EXPECT_NEAR(platform.hidden_drop_m, drop_m, 1e-5);
    const SurfaceShape stairs =
        rows_of([&](double x, double) { return -std::round(x / (apart * cell_m)); });
    EXPECT_NEAR(stairs.step_m, 1.0, 1e-5);
  }
}

TEST(SurfaceShape, AShallowPlatformBelowATerraceIsNoSlope) {
  for (const int deep : {2, 3, 4}) {
    GroundGrid ground = ground_of([](double x, double) {
      return x < -1.5 ? 0.7 : x > 1.7 ? -1.1 : 0.0;
    });
    for_each_cell(ground, [&](int x, int y) {
      const bool is_behind = x > middle - 8 && x <= middle - deep;
      const bool is_ahead = x > middle && x < middle + 9;
      if (is_behind || is_ahead) ground(x, y) = {};
    });
    EXPECT_NEAR(shape_in_the_middle(ground).hidden_drop_m, 1.1, 1e-5) << deep;
  }
}

TEST(SurfaceShape, NoiseOnASlopeIsSeldomAStep) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise_m(0.0, 0.012);
  constexpr int trials = 400;
  int steps = 0;
  for (int k = 0; k < trials; ++k) {
    const GroundGrid ground =
        ground_of([&](double x, double) { return 0.14 * x + noise_m(random); });
    steps += shape_in_the_middle(ground).step_m > 0.09F ? 1 : 0;
  }
  EXPECT_LT(steps, trials / 100);
}

}  // namespace
}  // namespace stillmap
