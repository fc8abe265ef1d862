#include <gmock/gmock.h>
#include <signal.h>

#include <map>
#include <mutex>
#include <random>

#include "core/frames/rigid_motion.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "tests/numbers.hpp"
#include "tests/server/robot_drive.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

TEST_F(Frames, PosesAreTheRobotsWhereverItsLidarSits) {
  start("frames: {base: base_link}\n" + std::string(tilted_mount_yaml));
  drive(0, 15, tilted_mount());
  expect_poses_of_base(15);
  // The covariance of a frame beneath the lidar is another one, not none.
  EXPECT_GT(updates(15).rbegin()->second.covariance(0, 0), 0.0);

  std::mutex mutex;
  Trajectory path;
  const auto subscription = client_->subscribe_path([&](const Trajectory& trajectory) {
    const std::scoped_lock lock(mutex);
    path = trajectory;
  });
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return path.size() == 15;
  }));
  const Eigen::Isometry3d T_end = T_room_base(0).inverse() * T_room_base(14);
  EXPECT_LT((path.back().T_map_lidar.translation() - T_end.translation()).norm(), 0.1);
}

TEST_F(Frames, TheMapIsLevelAndItsGroundIsWhereTheRobotStands) {
  start("frames: {base: base_link}\n" + std::string(tilted_mount_yaml));
  drive(0, 15, tilted_mount());
  std::size_t ground_voxels = 0;
  std::mutex mutex;
  std::map<TileId, Tile> tiles;
  const auto subscription =
      client_->subscribe_tiles([&](const dds::MapIdentity&, const Tile& tile) {
        const std::scoped_lock lock(mutex);
        tiles[tile.info.id] = tile;
      });
  ASSERT_TRUE(wait_for_scans(*client_, 15));
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return tiles.size() == client_->get_tile_versions().tiles.size();
  }));
  const std::scoped_lock lock(mutex);
  for (const auto& [id, tile] : tiles) {
    for (const Voxel& voxel : tile.voxels) {
      if (voxel.evidence.winner() != SemanticClass::road) continue;
      const double range_m = voxel.mean_map.head<2>().norm();
      EXPECT_NEAR(voxel.mean_map.z(), 0.0, 0.1 + max_rotation_error_rad * range_m)
          << voxel.mean_map.transpose();
      ++ground_voxels;
    }
  }
  EXPECT_GT(ground_voxels, 100U);
}

TEST_F(Frames, TheTransformTreeIsWhole) {
  start("frames: {base: base_link, odom: odom}\n" + std::string(tilted_mount_yaml));
  dds::Reader<tf2_msgs::msg::TFMessage> tf(*participant_, topics_.tf.dds_name, topics_.tf.reader);
  ASSERT_TRUE(tf.events().wait_for_writer(patience));
  drive(0, 3, tilted_mount());
  tf2_msgs::msg::TFMessage message;
  ASSERT_TRUE(tf.take(message, {}, patience));
  const std::vector<FrameTransform> chain = wire::from_tf(message);
  ASSERT_EQ(chain.size(), 2U);
  EXPECT_EQ(chain[0].parent, "map");
  EXPECT_EQ(chain[0].child, "odom");
  EXPECT_EQ(chain[1].parent, "odom");
  EXPECT_EQ(chain[1].child, "base_link");

  const auto fixed = sample(topics_.tf_static);
  ASSERT_TRUE(fixed);
  const std::vector<FrameTransform> mounts = wire::from_tf(*fixed);
  ASSERT_EQ(mounts.size(), 1U);
  EXPECT_EQ(mounts[0].parent, "base_link");
  EXPECT_EQ(mounts[0].child, "lidar");
  EXPECT_TRUE(mounts[0].T_parent_child.isApprox(tilted_mount(), 1e-9));
}

TEST_F(Frames, OdomGoesOnWhereTheMapBeginsAnew) {
  start("frames: {base: base_link, odom: odom}\n" + std::string(tilted_mount_yaml));
  dds::Reader<nav_msgs::msg::Odometry> local(*participant_, topics_.local_odometry.dds_name,
                                             topics_.local_odometry.reader);
  ASSERT_TRUE(local.events().wait_for_writer(patience));
  drive(0, 10, tilted_mount());
  ASSERT_TRUE(wait_for_scans(*client_, 10));
  (void)client_->reset();
  drive(10, 20, tilted_mount());
  const auto poses = updates(20);
  EXPECT_TRUE(poses.at(room_pose(10).stamp_ns)
                  .pose.T_map_lidar.isApprox(Eigen::Isometry3d::Identity(), 1e-6));
  std::optional<Eigen::Vector3d> last;
  double velocity_m_s = 0.0;
  for (int i = 0; i < 20; ++i) {
    nav_msgs::msg::Odometry message;
    ASSERT_TRUE(local.take(message, {}, patience)) << i;
    EXPECT_EQ(message.header().frame_id(), "odom");
    EXPECT_EQ(message.child_frame_id(), "base_link");
    const Eigen::Vector3d position = wire::from_odometry(message)->pose.T_map_lidar.translation();
    EXPECT_LT((position - last.value_or(position)).norm(), 0.3) << i;
    last = position;
    velocity_m_s = message.twist().twist().linear().x();
  }
  EXPECT_NEAR(velocity_m_s, 1.5, 0.3);
  const Eigen::Isometry3d T_end = T_room_base(0).inverse() * T_room_base(19);
  EXPECT_LT((*last - T_end.translation()).norm(), 0.3);
}

TEST_F(Frames, TheMountCanComeFromTheRobot) {
  start("frames: {base: base_link}\nmount: {source: tf_static, wait_s: 60}\n");
  dds::Writer<tf2_msgs::msg::TFMessage> robot(*participant_, topics_.tf_static.dds_name,
                                              topics_.tf_static.writer);
  const Eigen::Isometry3d T_base_mast = from_xyz_rpy({0.5, 0.0, 1.0}, {0.0, 0.0, 1.0});
  const auto message = wire::to_tf(0, {{"base_link", "mast", T_base_mast},
                                       {"mast", "lidar", T_base_mast.inverse() * tilted_mount()}});
  // No scan is lost that comes before the transform.
  drive(0, 3, tilted_mount());
  ASSERT_TRUE(robot.write(message));
  drive(3, 15, tilted_mount());
  expect_poses_of_base(15);
  EXPECT_EQ(client_->status().dropped(), 0U);
}

TEST_F(Frames, AMountThatNeverComesIsNamed) {
  start("frames: {base: base_link}\nmount: {source: tf_static, wait_s: 0.1}\n");
  drive(0, 3, tilted_mount());
  ASSERT_TRUE(wait_for_scans(*client_, 3));
  const dds::ServerStatus status = client_->status();
  EXPECT_EQ(status.dropped("unknown_frame"), 3U);
  EXPECT_THAT(status.reason, HasSubstr("no transform base_link -> lidar on /tf_static"));
  // The service goes on, and so does mapping once it is there.
  dds::Writer<tf2_msgs::msg::TFMessage> robot(*participant_, topics_.tf_static.dds_name,
                                              topics_.tf_static.writer);
  ASSERT_TRUE(robot.readers().wait_for_any(patience));
  ASSERT_TRUE(robot.write(wire::to_tf(0, {{"base_link", "lidar", tilted_mount()}})));
  int next = 3;
  EXPECT_TRUE(eventually([&] {
    drive(next, next + 1, tilted_mount());
    ++next;
    return client_->status().counter("scans_mapped") >= 3;
  }));
}

TEST_F(Frames, AMapIsResumedByARobotWithAnotherMount) {
  start("frames: {base: base_link}\nmount: {source: tf_static, wait_s: 60}\n");
  dds::Writer<tf2_msgs::msg::TFMessage> robot(*participant_, topics_.tf_static.dds_name,
                                              topics_.tf_static.writer);
  ASSERT_TRUE(robot.write(wire::to_tf(0, {{"base_link", "lidar", tilted_mount()}})));
  drive(0, 10, tilted_mount());
  ASSERT_TRUE(wait_for_scans(*client_, 10));
  server_->send(SIGTERM);
  ASSERT_EQ(server_->wait_for_exit(patience), 0);

  ASSERT_TRUE(robot.write(wire::to_tf(0, {{"base_link", "lidar", turned_mount()}})));
  server_.emplace(setup_.server_arguments());
  client_->wait_for_server(patience);
  publisher_.emplace(setup_.publisher(true));
  drive(10, 15, turned_mount());
  expect_poses_of_base(15);
}

Eigen::Isometry3d rear_mount() {
  return from_xyz_rpy({-0.8, 0.2, 1.2}, {0.0, 10.0 * deg, 180.0 * deg});
}

/// As the rear lidar publishes it, whose y points to the right.
Scan rear_scan(int i) {
  Scan scan = mounted_scan(i, rear_mount());
  for (Eigen::Vector3f& point : scan.points_lidar) point.y() = -point.y();
  return scan;
}

class SeveralLidars : public Frames {
 protected:
  SeveralLidars()
      : Frames(
            "sensors:\n"
            "  - {name: front, sensor: vlp_16, topic: front/points, xyz_m: [1.2, 0.1, 1.4],"
            " rpy_deg: [0, 15, 0]}\n"
            "  - {name: rear, sensor: vlp_16, topic: rear/points, frame: rear_lidar,"
            " fields: {y: [-y]}, xyz_m: [-0.8, 0.2, 1.2], rpy_deg: [0, 10, 180]}") {
    start("frames: {base: base_link}\n");
    front_.emplace(publisher_on("front/points", "front_lidar"));
    rear_.emplace(publisher_on("rear/points", "rear_lidar"));
  }

  [[nodiscard]] ScanPublisher publisher_on(const std::string& topic, const std::string& frame) {
    ScanPublisherOptions options = setup_.publisher(true);
    options.points_topic = topic;
    options.lidar_frame = frame;
    ScanPublisher publisher(options);
    EXPECT_TRUE(publisher.wait_for_subscriber(patience));
    return publisher;
  }

  std::optional<ScanPublisher> front_, rear_;
};

TEST_F(SeveralLidars, AreMappedAsOne) {
  constexpr int scans = 12;
  for (int i = 0; i < scans; ++i) {
    ASSERT_TRUE(front_->publish(mounted_scan(i, tilted_mount()), {}, patience));
    ASSERT_TRUE(rear_->publish(rear_scan(i), {}, patience));
  }
  expect_poses_of_base(scans);
  ASSERT_TRUE(wait_for_scans(*client_, scans));
  const dds::ServerStatus status = client_->status();
  EXPECT_EQ(status.counter("scans_mapped"), static_cast<std::uint64_t>(scans));
  EXPECT_EQ(status.dropped(), 0U);
  EXPECT_EQ(status.counter("sweeps_without", "rear"), 0U);
  const auto mount = sample(topics_.tf_static);
  ASSERT_TRUE(mount);
  const Eigen::Vector3d origin = wire::from_tf(*mount).at(0).T_parent_child.translation();
  EXPECT_TRUE(origin.isApprox(Eigen::Vector3d(0.2, 0.15, 1.3), 1e-9)) << origin.transpose();
}

TEST_F(SeveralLidars, GoOnWithoutOneThatFallsSilent) {
  constexpr int both = 5;
  constexpr int scans = 12;
  for (int i = 0; i < scans; ++i) {
    ASSERT_TRUE(front_->publish(mounted_scan(i, tilted_mount()), {}, patience));
    if (i >= both) continue;
    ASSERT_TRUE(rear_->publish(rear_scan(i), {}, patience));
  }
  expect_poses_of_base(scans);
  ASSERT_TRUE(wait_for_scans(*client_, scans));
  const dds::ServerStatus status = client_->status();
  EXPECT_EQ(status.counter("sweeps_without", "rear"), static_cast<std::uint64_t>(scans - both));
  EXPECT_EQ(status.counter("sweeps_without", "front"), 0U);
  EXPECT_EQ(status.dropped(), 0U);
}

TEST_F(SeveralLidars, OneThatNeverSendsIsNamed) {
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(front_->publish(mounted_scan(i, tilted_mount()), {}, patience));
  ASSERT_TRUE(wait_for_scans(*client_, 3));
  const dds::ServerStatus status = client_->status();
  EXPECT_THAT(status.diagnostics,
              testing::Contains(testing::Field(&dds::Diagnostic::what,
                                               HasSubstr("no scan received on rt/rear/points"))));
  EXPECT_THAT(status.diagnostics, testing::Not(testing::Contains(testing::Field(
                                      &dds::Diagnostic::what, HasSubstr("front/points")))));
}

TEST_F(SeveralLidars, ACloudOfNoneOfThemIsRefused) {
  ScanPublisher stranger = publisher_on("rear/points", "camera");
  ASSERT_TRUE(stranger.publish(rear_scan(0), {}, patience));
  EXPECT_TRUE(eventually([&] { return client_->status().dropped("unknown_frame") == 1; }));
  EXPECT_THAT(client_->status().reason, HasSubstr("'camera'"));
}

TEST_F(SeveralLidars, AreKnownByTheirFramesWithASlash) {
  ScanPublisher old_driver = publisher_on("rear/points", "/rear_lidar");
  constexpr int scans = 3;
  for (int i = 0; i < scans; ++i) {
    ASSERT_TRUE(front_->publish(mounted_scan(i, tilted_mount()), {}, patience));
    ASSERT_TRUE(old_driver.publish(rear_scan(i), {}, patience));
  }
  ASSERT_TRUE(wait_for_scans(*client_, scans));
  EXPECT_EQ(client_->status().dropped(), 0U);
}

}  // namespace
}  // namespace stillmap::test
