#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "core/traversability/ground_estimate.hpp"
#include "core/traversability/path_check.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::look;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;

const SurfaceCell& surface_at(const TraversabilityView& view, double x_m, double y_m) {
  return *look(view, x_m, y_m).surface;
}

/// A robot that drives over any ground, seen or not.
RobotProfile explorer() {
  RobotProfile robot = square_robot();
  robot.name = "explorer";
  for (const SemanticClass label : {road, terrain, unlabeled})
    robot.class_cost.at(static_cast<std::size_t>(label)) = 0.0;
  robot.max_step_m = 0.25;
  robot.unknown = UnknownGround::allowed;
  return robot;
}

/// A street along x from -8 to 8: road between y -4 and 2, a pavement 0.13 m higher beside it.
VoxelWorld street() {
  VoxelWorld world;
  world.ground(-8, -4, 8, 2, road);
  world.ground(-8, 2, 8, 5, sidewalk, [](double, double) { return 0.23; });
  return world;
}

TEST(GroundFill, PlaceOfARemovedCarBecomesInferredRoad) {
  VoxelWorld world = street();
  world.clear(-2.2, -1.0, 2.2, 0.8);
  const auto view = traversability_of(world.view(), square_robot());
  for (const double x_m : {-2.1, 0.1, 2.1}) {
    EXPECT_EQ(surface_at(*view, x_m, 0.1).ground.origin, GroundOrigin::inferred) << x_m;
    EXPECT_NEAR(surface_at(*view, x_m, 0.1).ground.height_m, 0.1, 1e-5);
    EXPECT_EQ(surface_at(*view, x_m, 0.1).ground.label, road);
    EXPECT_EQ(look(*view, x_m, 0.1).cell.state, CellState::free);
    EXPECT_TRUE(look(*view, x_m, 0.1).cell.inferred);
  }
}

TEST(GroundFill, AHoleThatHidesTheKerbIsFilledAlongItAndNeverAcross) {
  VoxelWorld world = street();
  world.clear(-2.2, 0.4, 2.2, 3.0);  // a car and its shadow over the kerb
  const auto view = traversability_of(world.view(), square_robot());
  for (double y_m = 0.5; y_m < 3.0; y_m += 0.2) {
    const GroundCell& ground = surface_at(*view, 0.1, y_m).ground;
    if (ground.origin != GroundOrigin::inferred) continue;
    const double true_m = y_m < 2.0 ? 0.1 : 0.23;
    EXPECT_NEAR(ground.height_m, true_m, 0.02) << "y " << y_m;
    EXPECT_EQ(ground.label, y_m < 2.0 ? road : sidewalk) << "y " << y_m;
  }
}

TEST(GroundFill, NotAcrossAStepEvenWithinOneClass) {
  VoxelWorld world;
  world.ground(-6, -6, 0, 6, road);
  world.ground(1, -6, 6, 6, road, [](double, double) { return 0.3; });
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(surface_at(*view, 0.5, 0.1).ground.origin, GroundOrigin::none);
  EXPECT_EQ(look(*view, 0.5, 0.1).cell.state, CellState::unknown);
}

TEST(GroundFill, AlongASlopeTheGapRisesWithIt) {
  VoxelWorld world;
  const auto slope = [](double x_m, double) { return 0.12 * x_m; };
  world.ground(-6, -6, 6, 6, road, slope);
  world.clear(-1, -1, 1, 1);
  const auto view = traversability_of(world.view(), square_robot());
  for (const double x_m : {-0.9, 0.1, 0.9}) {
    EXPECT_EQ(surface_at(*view, x_m, 0.1).ground.origin, GroundOrigin::inferred);
    EXPECT_NEAR(surface_at(*view, x_m, 0.1).ground.height_m, slope(x_m, 0.1), 0.01);
  }
}

TEST(GroundFill, NotOverMoreThanTheLongestGap) {
  VoxelWorld world;
  world.ground(-10, -10, 10, 10, road);
  world.clear(-5, -5, 5, 5);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 0.1, 0.1).cell.state, CellState::unknown);
  // On lines across a corner the gap is short enough.
  EXPECT_EQ(look(*view, 4.9, 4.9).cell.state, CellState::free);
}

TEST(GroundFill, NotThroughWhatStandsInTheGap) {
  VoxelWorld world;
  world.ground(-6, -6, 6, 6, road);
  world.clear(-1, -6, 1, 6);
  world.block(-0.2, -6, 0.2, 6, 0.2, 2.5, building);  // a wall on unknown ground
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_NE(surface_at(*view, 0.7, 0.1).ground.origin, GroundOrigin::inferred);
  EXPECT_EQ(look(*view, 0.1, 0.1).cell.reason, BlockReason::obstacle);
  EXPECT_EQ(look(*view, 0.7, 0.1).cell.state, CellState::unknown);
}

TEST(GroundFill, NotOverAPitOrADitchWhoseBottomWasMeasured) {
  // A workshop's pit in a hall, and a ditch whose bottom is overgrown: their banks are level.
  struct Drop {
    double width_m;
    double bottom_m;
    SemanticClass ground, bottom;
  };
  for (const Drop& drop :
       {Drop{1.0, -1.7, road, road}, {2.0, -0.7, terrain, vegetation}, {0.4, -1.0, road, road}}) {
    VoxelWorld world;
    world.ground(-6, -6, 6, 6, drop.ground);
    world.clear(0.0, -4.0, drop.width_m, 4.0);
    world.block(0.0, -4.0, drop.width_m, 4.0, drop.bottom_m - 0.2, drop.bottom_m, drop.bottom);
    const auto view = traversability_of(world.view(), square_robot());
    for (double x_m = 0.1; x_m < drop.width_m; x_m += 0.2) {
      for (const double y_m : {-3.9, -1.1, 0.1, 3.9})
        EXPECT_NE(look(*view, x_m, y_m).cell.state, CellState::free)
            << drop.width_m << " m wide, at " << x_m << ", " << y_m;
    }
    // What lies beside it is still ground.
    EXPECT_EQ(surface_at(*view, -1.1, 0.1).ground.origin, GroundOrigin::seen);
  }
}

TEST(GroundFill, NoRobotThatGoesThroughUnknownGroundCrossesADitchWhoseBottomWasMeasured) {
  for (const SemanticClass label : {terrain, unlabeled}) {
    for (const double depth_m : {0.6, 0.8, 1.2, 2.0}) {
      for (const double width_m : {0.6, 1.0, 2.0}) {
        // Wherever the blocks of the ground's level begin.
        for (const double from_m : {-1.0, -0.4, 0.0, 0.6}) {
          VoxelWorld world;
          world.ground(-6, -6, 8, 6, label);
          world.ground(from_m, -6, from_m + width_m, 6, label,
                       [depth_m](double, double) { return 0.1 - depth_m; });
          const auto view = traversability_of(world.view(), explorer());
          for (double y_m = -3.0; y_m < 3.1; y_m += 0.5) {
            const std::array<PlanarPose, 2> across{{{{-3.5, y_m}, 0.0}, {{5.5, y_m}, 0.0}}};
            EXPECT_FALSE(check_path(*view, across).is_free)
                << name(label) << ", " << depth_m << " m deep, " << width_m << " m wide from "
                << from_m << ", y " << y_m;
          }
          EXPECT_EQ(look(*view, -4.9, 0.1).cell.state, CellState::free);
        }
      }
    }
  }
}

TEST(GroundFill, ASlopeWithBushesOnItHasNoPit) {
  VoxelWorld world;
  const auto slope = [](double x_m, double) { return 0.4 * x_m; };
  world.ground(-7, -7, 7, 7, terrain, slope);
  world.clear(-1.6, -1.6, 1.6, 1.6);
  for (double x_m = -1.5; x_m < 1.6; x_m += 0.2)
    world.block(x_m - 0.1, -1.6, x_m + 0.1, 1.6, 0.4 * x_m, 0.4 * x_m + 0.1, vegetation);
  RobotProfile robot = explorer();
  robot.max_slope_deg = 30.0;
  const auto view = traversability_of(world.view(), robot);
  for (double x_m = -1.5; x_m < 1.6; x_m += 0.2)
    EXPECT_NE(look(*view, x_m, 0.1).cell.reason, BlockReason::step) << x_m;
}

TEST(GroundFill, BridgesTheGapsBetweenRings) {
  VoxelWorld world;
  for (double x_m = -6; x_m < 6; x_m += 1.0) world.ground(x_m, -6, x_m + 0.2, 6, road);
  const auto view = traversability_of(world.view(), square_robot());
  for (double x_m = -3.9; x_m < 4; x_m += 0.2) {
    EXPECT_EQ(look(*view, x_m, 0.1).cell.state, CellState::free) << x_m;
  }
}

TEST(GroundFill, NothingIsInferredBeyondTheEdgeOfWhatWasSeen) {
  VoxelWorld world;
  world.ground(-4, -4, 2.1, 4, road);
  const auto view = traversability_of(world.view(), square_robot());
  EXPECT_EQ(look(*view, 2.5, 0.1).cell.state, CellState::unknown);
}

TEST(GroundFill, NotOverATrenchOfWhichOnlyTheFarWallWasMeasured) {
  // From in front of it a lidar sees neither its bottom nor its near wall. The far wall is one cell
  // deep: in the gap, or in the column of the ground at its edge.
  for (const double width_m : {1.0, 1.6, 2.4}) {
    for (const double wall_m : {width_m - 0.2, width_m}) {
      for (const SemanticClass wall : {building, road}) {
        VoxelWorld world;
        world.ground(-6, -6, 8, 6, road);
        world.clear(0.0, -6, width_m, 6);
        world.block(wall_m, -6, wall_m + 0.2, 6, -0.9, -0.2, wall);
        const auto view = traversability_of(world.view(), square_robot());
        for (double x_m = 0.1; x_m < width_m; x_m += 0.2) {
          for (const double y_m : {-3.9, 0.1, 3.9})
            EXPECT_NE(look(*view, x_m, y_m).cell.state, CellState::free)
                << width_m << " m wide, " << name(wall) << " at " << wall_m << ": " << x_m;
        }
      }
    }
  }
}

TEST(GroundFill, NoExplorerDrivesOverAPlatformsEdge) {
  for (const double lower_m : {0.55, 1.1}) {
    for (const SemanticClass label : {road, unlabeled}) {
      VoxelWorld world;
      world.ground(-6, -6, 0, 6, label);
      const double hidden_m = 2.8 * lower_m;  // seen over the edge from 5 m, 1.8 m above it
      world.ground(hidden_m, -6, 10, 6, label, [&](double, double) { return 0.1 - lower_m; });
      const auto view = traversability_of(world.view(), explorer());
      EXPECT_EQ(look(*view, -0.1, 0.1).cell.reason, BlockReason::step) << lower_m;
      for (const double y_m : {-2.0, 0.0, 2.0}) {
        const std::vector<PlanarPose> path{{{-3, y_m}, 0.0}, {{hidden_m + 2, y_m}, 0.0}};
        EXPECT_FALSE(check_path(*view, path).is_free) << lower_m << " m, " << name(label);
      }
    }
  }
}

TEST(GroundFill, OneReflectionBelowTheGroundIsNoPit) {
  for (const double x_m : {0.0, 1.0}) {  // in the gap, and below the ground at its edge
    VoxelWorld world;
    world.ground(-6, -6, 6, 6, road);
    world.clear(0.0, -2, 1.0, 2);
    world.block(x_m, 0.0, x_m + 0.2, 0.2, -0.9, -0.8, unlabeled);
    const auto view = traversability_of(world.view(), square_robot());
    EXPECT_EQ(surface_at(*view, 0.5, 0.1).ground.origin, GroundOrigin::inferred) << x_m;
  }
}

TEST(GroundFill, AFewReflectionsBelowTheGroundAreNothingThatStopsARobot) {
  // A road that was seen and mirrors what stands beside it, and two cells of which it was not seen.
  for (const SemanticClass label : {road, unlabeled}) {
    VoxelWorld world;
    world.ground(-6, -6, 6, 6, label);
    world.block(-2, -2, 0, 0, -1.3, -1.1, unlabeled);
    world.clear(2.0, 2.0, 2.4, 2.2);
    world.block(2.0, 2.0, 2.4, 2.2, -1.1, -0.9, unlabeled);
    const auto view = traversability_of(world.view(), explorer());
    for (double x_m = -3.9; x_m < 4.0; x_m += 0.2) {
      for (double y_m = -3.9; y_m < 4.0; y_m += 0.2)
        EXPECT_NE(look(*view, x_m, y_m).cell.state, CellState::lethal)
            << name(label) << ", " << x_m << ", " << y_m;
    }
  }
}

}  // namespace
}  // namespace stillmap
