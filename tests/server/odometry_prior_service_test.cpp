#include <gmock/gmock.h>

#include <random>
#include <thread>

#include "idl/conversions/pose.hpp"
#include "idl/dds/writer.hpp"
#include "tests/server/robot_drive.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

/// A scan that shows nothing: its pose is where it is expected.
Scan empty_air(std::int64_t stamp_ns) {
  Scan scan;
  scan.stamp_ns = stamp_ns;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> anywhere(-20.0F, 20.0F);
  for (int i = 0; i < 3000; ++i) {
    scan.points_lidar.emplace_back(anywhere(random), anywhere(random), 0.2F * anywhere(random));
    scan.intensity.push_back(0.0F);
    scan.ring.push_back(static_cast<std::uint16_t>(i % 16));
  }
  return scan;
}

class OdometryPriorFrames : public Frames {
 protected:
  static constexpr int seen_scans = 12;
  /// The first scans may be mapped before the server has read a pose of the wheels.
  static constexpr std::chrono::seconds few_patience{3};

  using Tf = dds::Reader<tf2_msgs::msg::TFMessage>;

  void start_with_own_odom() {
    start("frames: {base: base_link, odom: wheel_odom, odom_source: prior}\n" +
          std::string(turned_mount_yaml));
  }
  static std::string wheels_topic() { return dds::odometry_prior_topic("odom_prior").dds_name; }

  /// Wheels that say that the robot goes as in the room, and then ahead and round a curve.
  static Eigen::Isometry3d T_wheels_base(int index) {
    if (index < seen_scans) return T_room_base(index);
    const Eigen::Isometry3d step = from_xyz_rpy({0.6, 0.0, 0.0}, {0.0, 0.0, 0.2});
    return T_wheels_base(index - 1) * step;
  }

  /// Drives with all of the wheels' poses sent before every scan: the server's reader finds their
  /// writer at some time, and leaves out what it has.
  void drive_with_wheels(
      int scans, const std::string& child_frame,
      const Eigen::Isometry3d& T_wheels_after_reset = Eigen::Isometry3d::Identity(),
      int poses = seen_scans + 2, const std::string& odom_frame = "wheel_odom") {
    dds::Writer<nav_msgs::msg::Odometry> wheels(*participant_, wheels_topic(), {.depth = 100});
    ASSERT_TRUE(wheels.readers().wait_for_any(patience));
    // Once: what came earlier and comes again looks like a clock that was set back.
    for (int i = 0; i < poses; ++i) {
      const auto none = Eigen::Matrix<double, 6, 6>::Zero();
      const Eigen::Isometry3d T =
          i < seen_scans / 2 ? T_wheels_base(i) : T_wheels_after_reset * T_wheels_base(i);
      ASSERT_TRUE(wheels.write(
          wire::to_odometry({room_pose(i).stamp_ns, T}, none, odom_frame, child_frame)));
    }
    for (int scan = 0; scan < scans; ++scan) {
      drive(scan, scan + 1, turned_mount());
      ASSERT_TRUE(wait_for_scans(*client_, static_cast<std::uint64_t>(scan + 1)));
    }
  }
};

TEST_F(OdometryPriorFrames, MotionOfTheBasePredictsTheLidars) {
  start("frames: {base: base_link}\n" + std::string(turned_mount_yaml));
  drive_with_wheels(seen_scans, "base_link");
  ASSERT_TRUE(publisher_->publish(empty_air(room_pose(seen_scans).stamp_ns), {}, patience));
  const auto poses = updates(seen_scans + 1);
  ASSERT_EQ(client_->status().health, OdometryHealth::lost);
  const Eigen::Isometry3d T_last = poses.at(room_pose(seen_scans - 1).stamp_ns).pose.T_map_lidar;
  const Eigen::Isometry3d T_now = poses.at(room_pose(seen_scans).stamp_ns).pose.T_map_lidar;
  const Eigen::Isometry3d step =
      T_wheels_base(seen_scans - 1).inverse() * T_wheels_base(seen_scans);
  EXPECT_TRUE((T_last.inverse() * T_now).isApprox(step, 1e-6))
      << (T_last.inverse() * T_now).matrix();
  EXPECT_EQ(client_->status().counter("odometry_prior_unknown_frame"), 0U);
}

TEST_F(OdometryPriorFrames, WheelsThatHaveTheirOwnOdomGetOnlyItsPlaceInTheMap) {
  start_with_own_odom();
  Tf tf(*participant_, topics_.tf.dds_name, topics_.tf.reader);
  ASSERT_TRUE(tf.events().wait_for_writer(patience));
  drive_with_wheels(seen_scans, "base_link");
  std::vector<FrameTransform> last;
  int told = 0;
  tf2_msgs::msg::TFMessage message;
  while (told < seen_scans && tf.take(message, {}, few_patience)) {
    last = wire::from_tf(message);
    ASSERT_EQ(last.size(), 1U);
    ++told;
  }
  ASSERT_GE(told, seen_scans / 2);
  EXPECT_EQ(last[0].parent, "map");
  EXPECT_EQ(last[0].child, "wheel_odom");
  // The wheels count from the middle of the room, the map from the first scan.
  const Eigen::Isometry3d T_error = T_room_base(0) * last[0].T_parent_child;
  EXPECT_LT(T_error.translation().norm(), 0.1);
  EXPECT_LT(Eigen::AngleAxisd(T_error.linear()).angle(), 1.0 * deg);
}

TEST_F(OdometryPriorFrames, WheelsThatAreLateStillTellWhereTheirOdomIs) {
  start_with_own_odom();
  Tf tf(*participant_, topics_.tf.dds_name, topics_.tf.reader);
  ASSERT_TRUE(tf.events().wait_for_writer(patience));
  dds::Writer<nav_msgs::msg::Odometry> wheels(*participant_, wheels_topic(), {.depth = 100});
  ASSERT_TRUE(wheels.readers().wait_for_any(patience));
  constexpr int late_scans = 3;
  const Eigen::Isometry3d T_start = from_xyz_rpy({100.0, 50.0, 0.0}, {0.0, 0.0, 1.0});
  for (int i = 0; i < 2 * seen_scans; ++i) {
    drive(i, i + 1, turned_mount());
    ASSERT_TRUE(wait_for_scans(*client_, static_cast<std::uint64_t>(i + 1)));
    if (i < late_scans) continue;
    const auto none = Eigen::Matrix<double, 6, 6>::Zero();
    ASSERT_TRUE(wheels.write(wire::to_odometry(
        {room_pose(i - late_scans).stamp_ns, T_start * T_room_base(i - late_scans)}, none,
        "wheel_odom", "base_link")));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  int told = 0;
  tf2_msgs::msg::TFMessage message;
  while (tf.take(message, {}, std::chrono::milliseconds(200))) {
    const std::vector<FrameTransform> chain = wire::from_tf(message);
    ASSERT_EQ(chain.size(), 1U);
    EXPECT_EQ(chain[0].child, "wheel_odom");
    const Eigen::Isometry3d T_error = T_room_base(0) * chain[0].T_parent_child * T_start;
    EXPECT_LT(T_error.translation().norm(), 0.1) << told;
    ++told;
  }
  EXPECT_GT(told, seen_scans);
  EXPECT_LE(told, 2 * seen_scans - late_scans) << "before, nobody knows where it is";
  const dds::ServerStatus status = client_->status();
  EXPECT_GT(status.counter("odometry_prior_missing"), 5U);
  EXPECT_THAT(status.reason, HasSubstr("too late"));
}

TEST_F(OdometryPriorFrames, WheelsWithoutAnOrientationAreNamed) {
  start_with_own_odom();
  Tf tf(*participant_, topics_.tf.dds_name, topics_.tf.reader);
  ASSERT_TRUE(tf.events().wait_for_writer(patience));
  dds::Writer<nav_msgs::msg::Odometry> wheels(*participant_, wheels_topic(), {.depth = 100});
  ASSERT_TRUE(wheels.readers().wait_for_any(patience));
  for (int i = 0; i < seen_scans; ++i) {
    const auto none = Eigen::Matrix<double, 6, 6>::Zero();
    auto pose =
        wire::to_odometry({room_pose(i).stamp_ns, T_room_base(i)}, none, "wheel_odom", "base_link");
    pose.pose().pose().orientation({});
    pose.pose().pose().orientation().w(0.0);
    ASSERT_TRUE(wheels.write(pose));
    drive(i, i + 1, turned_mount());
    ASSERT_TRUE(wait_for_scans(*client_, static_cast<std::uint64_t>(i + 1)));
  }
  tf2_msgs::msg::TFMessage message;
  EXPECT_FALSE(tf.take(message, {}, std::chrono::milliseconds(200)));
  const dds::ServerStatus status = client_->status();
  EXPECT_GE(status.counter("odometry_prior_not_usable"), 1U);
  EXPECT_THAT(status.reason, HasSubstr("wheel_odom is not published"));
  EXPECT_THAT(status.reason, HasSubstr("an orientation that is none"));
}

TEST_F(OdometryPriorFrames, WheelsThatBeginAnewAreNotFollowed) {
  start("frames: {base: base_link}\n" + std::string(turned_mount_yaml));
  drive_with_wheels(seen_scans, "base_link", from_xyz_rpy({1e200, 0.0, 0.0}, {0.0, 0.0, 1.0}));
  expect_poses_of_base(seen_scans);
  EXPECT_EQ(client_->status().counter("odometry_prior_jumps"), 1U);
  EXPECT_EQ(client_->status().dropped(), 0U);
}

TEST_F(OdometryPriorFrames, AFrameThatIsNowhereOnTheRobotIsRefused) {
  start("frames: {base: base_link}\n" + std::string(turned_mount_yaml));
  drive_with_wheels(seen_scans, "trailer");
  expect_poses_of_base(seen_scans);
  EXPECT_GE(client_->status().counter("odometry_prior_unknown_frame"), 1U);
  EXPECT_EQ(client_->status().dropped(), 0U);
}

TEST_F(OdometryPriorFrames, TheirOwnOdomStaysWhereItIsWhileTheNextPoseIsOnItsWay) {
  start_with_own_odom();
  Tf tf(*participant_, topics_.tf.dds_name, topics_.tf.reader);
  ASSERT_TRUE(tf.events().wait_for_writer(patience));
  // The newest pose is of the last scan but one; frames are named as drivers of old did.
  drive_with_wheels(seen_scans, "/base_link", Eigen::Isometry3d::Identity(), seen_scans - 1,
                    "/wheel_odom");
  std::vector<Eigen::Vector3d> origin_map;
  tf2_msgs::msg::TFMessage message;
  while (origin_map.size() < seen_scans && tf.take(message, {}, few_patience)) {
    const std::vector<FrameTransform> chain = wire::from_tf(message);
    ASSERT_EQ(chain.size(), 1U);
    EXPECT_EQ(chain[0].child, "wheel_odom");
    origin_map.push_back(chain[0].T_parent_child.translation());
  }
  ASSERT_GE(origin_map.size(), seen_scans / 2);
  // The robot has gone 0.15 m since.
  EXPECT_LT((origin_map.back() - origin_map.at(origin_map.size() - 2)).norm(), 0.08);
}

}  // namespace
}  // namespace stillmap::test
