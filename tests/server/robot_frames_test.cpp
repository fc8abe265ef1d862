#include "server/mapping/robot_frames.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/frames/rigid_motion.hpp"

namespace stillmap::server {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

Eigen::Isometry3d mount() { return from_xyz_rpy({1.0, 0.0, 0.5}, {0.0, 0.3, 1.5}); }

ServerConfig mounted() {
  ServerConfig config;
  config.frames.base = "base_link";
  config.mount.T_base_lidar = mount();
  return config;
}

ServerConfig from_tf_static(double wait_s, bool identity_if_missing) {
  ServerConfig config;
  config.frames.base = "base_link";
  config.frames.lidar = "";
  config.mount = {.source = MountConfig::Source::tf_static,
                  .wait_s = wait_s,
                  .identity_if_missing = identity_if_missing};
  return config;
}

std::uint64_t count_of(const Statistics& statistics, const std::string& counter) {
  dds::ServerStatus status;
  statistics.report_to(status);
  return status.counter(counter);
}

TEST(RobotFrames, TheLidarIsTheBaseUnlessToldOtherwise) {
  Statistics statistics;
  RobotFrames frames(ServerConfig{}, nullptr, statistics);
  ASSERT_TRUE(frames.locate_lidar("velodyne", true));
  EXPECT_EQ(frames.base(), "lidar");
  EXPECT_EQ(frames.lidar(), "lidar");
  EXPECT_TRUE(frames.T_base_lidar().isApprox(Eigen::Isometry3d::Identity()));
}

TEST(RobotFrames, TakesTheCloudsNameForItsLidarWhereNoneIsConfigured) {
  ServerConfig config = mounted();
  config.frames.lidar = "";
  Statistics statistics;
  RobotFrames frames(config, nullptr, statistics);
  ASSERT_TRUE(frames.locate_lidar("velodyne", true));
  EXPECT_EQ(frames.base(), "base_link");
  EXPECT_EQ(frames.lidar(), "velodyne");
}

TEST(RobotFrames, KnowsWhereBaseAndLidarAre) {
  Statistics statistics;
  RobotFrames frames(mounted(), nullptr, statistics);
  ASSERT_TRUE(frames.locate_lidar("velodyne", true));
  EXPECT_TRUE(frames.T_lidar_frame("base_link")->isApprox(mount().inverse()));
  // The lidar by both of its names.
  EXPECT_TRUE(frames.T_lidar_frame("lidar")->isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_TRUE(frames.T_lidar_frame("velodyne")->isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_FALSE(frames.T_lidar_frame("base_footprint"));
  EXPECT_FALSE(frames.T_lidar_frame(""));
}

TEST(RobotFrames, KnowsNoBaseWithoutConfiguration) {
  Statistics statistics;
  RobotFrames frames(ServerConfig{}, nullptr, statistics);
  ASSERT_TRUE(frames.locate_lidar("lidar", true));
  EXPECT_FALSE(frames.T_lidar_frame("base_link"));
  EXPECT_TRUE(frames.T_lidar_frame("lidar"));
}

TEST(RobotFrames, SaysWhichTransformIsMissingAndWhatToDo) {
  Statistics statistics;
  RobotFrames frames(from_tf_static(0.0, false), nullptr, statistics);
  EXPECT_FALSE(frames.locate_lidar("velodyne", true));
  EXPECT_THAT(frames.missing(), AllOf(HasSubstr("base_link -> velodyne"), HasSubstr("/tf_static"),
                                      HasSubstr("robot_state_publisher")));
  EXPECT_EQ(count_of(statistics, "mount_missing"), 1U);
}

TEST(RobotFrames, TakesTheLidarForTheBaseOnlyWhereThatIsConfiguredAndAfterTheWait) {
  Statistics statistics;
  RobotFrames patient(from_tf_static(3600.0, true), nullptr, statistics);
  EXPECT_FALSE(patient.locate_lidar("velodyne", true));
  EXPECT_EQ(count_of(statistics, "mount_missing"), 0U);
  RobotFrames hasty(from_tf_static(0.0, true), nullptr, statistics);
  EXPECT_TRUE(hasty.locate_lidar("velodyne", true));
  EXPECT_EQ(count_of(statistics, "mount_missing"), 1U);
  EXPECT_TRUE(hasty.T_base_lidar().isApprox(Eigen::Isometry3d::Identity()));
  EXPECT_EQ(hasty.base(), "base_link");
}

TEST(RobotFrames, AMapIsMadeOfOneLidar) {
  Statistics statistics;
  RobotFrames frames(from_tf_static(0.0, true), nullptr, statistics);
  ASSERT_TRUE(frames.locate_lidar("front", true));
  EXPECT_FALSE(frames.locate_lidar("rear", false));
  EXPECT_THAT(frames.missing(), AllOf(HasSubstr("front"), HasSubstr("rear"), HasSubstr("sensors")));
  EXPECT_EQ(frames.lidar(), "front");
  EXPECT_TRUE(frames.locate_lidar("front", false));
  EXPECT_TRUE(frames.locate_lidar("rear", true)) << "of another map";
  EXPECT_EQ(frames.lidar(), "rear");
}

TEST(RobotFrames, ShowsNoMoreOfAForeignNameThanALine) {
  Statistics statistics;
  RobotFrames frames(from_tf_static(0.0, false), nullptr, statistics);
  EXPECT_FALSE(frames.locate_lidar("velo\ndyne" + std::string(1'000'000, 'x'), true));
  EXPECT_THAT(frames.missing(), HasSubstr("base_link -> velo?dynexxx"));
  EXPECT_LT(frames.missing().size(), 1000U);
}

TEST(RobotFrames, KnowsTheLidarWithOrWithoutASlash) {
  ServerConfig config = mounted();
  config.frames.lidar = "";
  Statistics statistics;
  RobotFrames frames(config, nullptr, statistics);
  ASSERT_TRUE(frames.locate_lidar("/velodyne", true));
  EXPECT_TRUE(frames.T_lidar_frame("velodyne"));
  EXPECT_TRUE(frames.T_lidar_frame("/velodyne"));
  EXPECT_FALSE(frames.T_lidar_frame("imu"));
}

}  // namespace
}  // namespace stillmap::server
