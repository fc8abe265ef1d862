#include "core/traversability/robot_profile.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(RobotProfile, CirclesOfACentredFootprint) {
  RobotProfile robot = test::square_robot();
  robot.length_m = 4.0;
  robot.width_m = 3.0;
  EXPECT_DOUBLE_EQ(robot.inscribed_radius_m(), 1.5);
  EXPECT_DOUBLE_EQ(robot.circumscribed_radius_m(), 2.5);
}

TEST(RobotProfile, CirclesAreRoundThePoseAndNotRoundTheCentre) {
  RobotProfile robot = test::square_robot();
  robot.length_m = 4.0;
  robot.width_m = 3.0;
  robot.centre_ahead_m = 1.0;
  EXPECT_DOUBLE_EQ(robot.inscribed_radius_m(), 1.0);
  EXPECT_DOUBLE_EQ(robot.circumscribed_radius_m(), std::hypot(3.0, 1.5));
}

TEST(RobotProfile, ObstacleIsWhatEitherWheelsOrBellyCannotPass) {
  RobotProfile robot = test::square_robot();
  robot.max_step_m = 0.3;
  robot.ground_clearance_m = 0.2;
  EXPECT_DOUBLE_EQ(robot.obstacle_height_m(), 0.2);
  robot.max_step_m = 0.1;
  EXPECT_DOUBLE_EQ(robot.obstacle_height_m(), 0.1);
}

TEST(RobotProfile, AUsableOneHasNoFaults) { EXPECT_EQ(test::square_robot().faults(), ""); }

TEST(RobotProfile, ListsEveryFault) {
  RobotProfile robot = test::square_robot();
  robot.name = "";
  robot.width_m = std::numeric_limits<double>::quiet_NaN();
  robot.max_step_m = 0.0;
  robot.max_slope_deg = 90.0;
  robot.ground_clearance_m = 1.6;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::road)) = 1.5;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::building)) = 0.5;
  EXPECT_THAT(robot.faults(),
              AllOf(HasSubstr("name"), HasSubstr("width_m = nan"), HasSubstr("max_step_m = 0"),
                    HasSubstr("max_slope_deg = 90"), HasSubstr("height_m = 1.5"),
                    HasSubstr("cost of road = 1.5"), HasSubstr("building")));
}

TEST(RobotProfile, OneThatMayEnterNothingIsAFault) {
  RobotProfile robot = test::square_robot();
  robot.class_cost.fill(std::nullopt);
  EXPECT_THAT(robot.faults(), HasSubstr("every class of ground is lethal"));
}

TEST(RobotProfile, ThePoseMustLieInTheFootprint) {
  RobotProfile robot = test::square_robot();
  robot.centre_ahead_m = 0.5;
  EXPECT_THAT(robot.faults(), HasSubstr("centre_ahead_m"));
}

}  // namespace
}  // namespace stillmap
