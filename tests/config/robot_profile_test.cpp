#include "config/loaders/robot_profile.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

using test::refusal;
using test::shipped;
using test::write_file;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* whole_robot =
    "name: cart\nlength_m: 2\nwidth_m: 1\ncentre_ahead_m: 0.5\nmin_turning_radius_m: "
    "3.5\nground_clearance_m: 0.12\n"
    "height_m: 1.8\nmax_step_m: 0.07\nmax_slope_deg: 12\nmax_roughness_m: 0.04\n"
    "inferred_cost: 0.25\nunknown: allowed\n"
    "class_cost: {road: 0.5, parking: 0.25, sidewalk: 0, other-ground: 1, terrain: lethal, "
    "unlabeled: lethal}\n";

std::optional<double> cost(const RobotProfile& robot, SemanticClass label) {
  return robot.class_cost.at(static_cast<std::size_t>(label));
}

TEST(RobotProfileFile, EveryFieldIsRead) {
  const RobotProfile robot = read_robot_profile(write_file("cart.yaml", whole_robot));
  EXPECT_EQ(robot.name, "cart");
  EXPECT_EQ(robot.length_m, 2.0);
  EXPECT_EQ(robot.width_m, 1.0);
  EXPECT_EQ(robot.centre_ahead_m, 0.5);
  EXPECT_EQ(robot.min_turning_radius_m, 3.5);
  EXPECT_EQ(robot.ground_clearance_m, 0.12);
  EXPECT_EQ(robot.height_m, 1.8);
  EXPECT_EQ(robot.max_step_m, 0.07);
  EXPECT_EQ(robot.max_slope_deg, 12.0);
  EXPECT_EQ(robot.max_roughness_m, 0.04);
  EXPECT_EQ(robot.inferred_cost, 0.25);
  EXPECT_EQ(robot.unknown, UnknownGround::allowed);
  EXPECT_EQ(cost(robot, SemanticClass::road), 0.5);
  EXPECT_EQ(cost(robot, SemanticClass::sidewalk), 0.0);
  EXPECT_EQ(cost(robot, SemanticClass::other_ground), 1.0);
  EXPECT_EQ(cost(robot, SemanticClass::terrain), std::nullopt);
  EXPECT_EQ(cost(robot, SemanticClass::building), std::nullopt);
}

TEST(RobotProfileFile, ShippedRobotsCanBeUsedAndDifferWhereTheyMust) {
  const RobotProfile car = load_robot_profile("car");
  const RobotProfile delivery = load_robot_profile("delivery_robot");
  const RobotProfile tracked = load_robot_profile("tracked");
  for (const RobotProfile* robot : {&car, &delivery, &tracked}) EXPECT_EQ(robot->faults(), "");
  EXPECT_EQ(cost(car, SemanticClass::sidewalk), std::nullopt);
  EXPECT_LT(cost(delivery, SemanticClass::sidewalk), cost(delivery, SemanticClass::road));
  EXPECT_TRUE(cost(tracked, SemanticClass::terrain).has_value());
  EXPECT_GT(tracked.max_step_m, car.max_step_m);
  EXPECT_GT(car.min_turning_radius_m, 2.0);
  EXPECT_EQ(tracked.min_turning_radius_m, 0.0);
}

TEST(RobotProfileFile, ShippedFilesBearTheNamesOfTheirRobots) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(shipped("robots"))) {
    EXPECT_EQ(read_robot_profile(entry.path()).name, entry.path().stem());
    ++files;
  }
  EXPECT_EQ(files, 3);
}

TEST(RobotProfileFile, ListsEveryFaultWithItsLine) {
  std::string text = whole_robot;
  text.replace(text.find("length_m: 2"), 11, "length_m: x");
  text.replace(text.find("road: 0.5"), 9, "road: 1.5");
  text.replace(text.find("terrain: lethal"), 15, "terrain: deadly");
  text.append("colour: red\n");
  const std::string faults =
      refusal([&] { (void)read_robot_profile(write_file("cart.yaml", text)); });
  EXPECT_THAT(faults, AllOf(HasSubstr("cart.yaml:2"), HasSubstr("length_m"), HasSubstr("'1.5'"),
                            HasSubstr("'deadly'"), HasSubstr("or lethal"), HasSubstr("colour")));
}

TEST(RobotProfileFile, DemandsACostForEveryGround) {
  std::string text = whole_robot;
  text.replace(text.find("parking: 0.25, "), 15, "");
  text.replace(text.find("sidewalk: 0,"), 12, "sidewalk: '',");
  const std::string faults =
      refusal([&] { (void)read_robot_profile(write_file("cart.yaml", text)); });
  EXPECT_THAT(faults,
              AllOf(HasSubstr("class_cost.parking: is missing"), HasSubstr("class_cost.sidewalk")));
}

TEST(RobotProfileFile, SaysWhatDoesNotFitTogether) {
  std::string text = whole_robot;
  text.replace(text.find("centre_ahead_m: 0.5"), 19, "centre_ahead_m: 1.5");
  EXPECT_THAT(refusal([&] { (void)read_robot_profile(write_file("cart.yaml", text)); }),
              HasSubstr("less than half of length_m"));
}

TEST(RobotProfileFile, NamesTheRobotsThereAreWhenThereIsNoSuchOne) {
  EXPECT_THAT(refusal([] { (void)load_robot_profile("hovercraft"); }),
              AllOf(HasSubstr("hovercraft"), HasSubstr("car, delivery_robot")));
  EXPECT_THAT(refusal([] { (void)load_robot_profile("trackd"); }), HasSubstr("tracked"));
  EXPECT_THAT(refusal([] { (void)load_robot_profile("nowhere/car.yaml"); }),
              HasSubstr("nowhere/car.yaml"));
}

TEST(RobotProfileFile, AFolderOfOnesOwnComesFirst) {
  const auto file = write_file("car.yaml", whole_robot);
  setenv("STILLMAP_ROBOTS", file.parent_path().c_str(), 1);
  EXPECT_EQ(load_robot_profile("car").name, "cart");
  unsetenv("STILLMAP_ROBOTS");
  EXPECT_EQ(load_robot_profile("car").name, "car");
}

}  // namespace
}  // namespace stillmap
