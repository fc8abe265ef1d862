#pragma once

#include <gtest/gtest.h>

#include <map>
#include <mutex>
#include <numbers>
#include <optional>
#include <string>

#include "core/frames/rigid_motion.hpp"
#include "idl/dds/reader.hpp"
#include "idl/interface/topics.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {

inline constexpr double deg = std::numbers::pi / 180.0;
/// Of the odometry in a bare hall seen with 16 rings; a mount that is ignored is 15 times as much.
inline constexpr double max_rotation_error_rad = 1.0 * deg;
/// Of the room, beneath the lidar of room_pose().
inline constexpr double ground_z_m = -1.5;

/// A lidar 1.2 m ahead that looks down by 15 degrees.
inline Eigen::Isometry3d tilted_mount() {
  return from_xyz_rpy({1.2, 0.1, 1.4}, {0.0, 15.0 * deg, 0.0});
}
inline constexpr const char* tilted_mount_yaml =
    "mount: {xyz_m: [1.2, 0.1, 1.4], rpy_deg: [0, 15, 0]}\n";
/// One that looks to the left, 1 m ahead.
inline Eigen::Isometry3d turned_mount() {
  return from_xyz_rpy({1.0, 0.0, 1.5}, {0.0, 0.0, 90.0 * deg});
}
inline constexpr const char* turned_mount_yaml =
    "mount: {xyz_m: [1, 0, 1.5], rpy_deg: [0, 0, 90]}\n";

/// The robot on the ground of the room.
inline Eigen::Isometry3d T_room_base(int index) {
  return Eigen::Translation3d(0.0, 0.0, ground_z_m) * room_pose(index).T_map_lidar;
}

inline Scan mounted_scan(int index, const Eigen::Isometry3d& T_base_lidar) {
  return seen_in_room({room_pose(index).stamp_ns, T_room_base(index) * T_base_lidar});
}

class Frames : public testing::Test {
 protected:
  explicit Frames(const std::string& sensors = "sensor: vlp_16")
      : setup_("every", "save_period_s: 3600", sensors) {}

  void start(const std::string& yaml) {
    setup_.add(yaml);
    server_.emplace(setup_.server_arguments());
    client_.emplace(setup_.client());
    client_->wait_for_server(patience);
    participant_.emplace(setup_.dds());
    odometry_ = client_->subscribe_odometry([this](const OdometryUpdate& update) {
      const std::scoped_lock lock(mutex_);
      updates_.emplace(update.pose.stamp_ns, update);
    });
    publisher_.emplace(setup_.publisher(true));
  }

  void drive(int first, int last, const Eigen::Isometry3d& T_base_lidar) {
    ASSERT_TRUE(publisher_->wait_for_subscriber(patience));
    for (int i = first; i < last; ++i) {
      ASSERT_TRUE(publisher_->publish(mounted_scan(i, T_base_lidar), {}, patience));
    }
  }

  [[nodiscard]] std::map<std::int64_t, OdometryUpdate> updates(std::size_t count) {
    EXPECT_TRUE(eventually([&] {
      const std::scoped_lock lock(mutex_);
      return updates_.size() >= count;
    }));
    const std::scoped_lock lock(mutex_);
    return updates_;
  }

  void expect_poses_of_base(int scans) {
    const auto poses = updates(static_cast<std::size_t>(scans));
    const Eigen::Isometry3d T_start = T_room_base(0).inverse();
    for (int i = 0; i < scans; ++i) {
      const auto found = poses.find(room_pose(i).stamp_ns);
      ASSERT_NE(found, poses.end()) << i;
      const OdometryUpdate& update = found->second;
      EXPECT_EQ(update.frame, "map");
      EXPECT_EQ(update.child_frame, "base_link");
      const Eigen::Isometry3d T_error =
          (T_start * T_room_base(i)).inverse() * update.pose.T_map_lidar;
      EXPECT_LT(T_error.translation().norm(), 0.1) << i;
      EXPECT_LT(Eigen::AngleAxisd(T_error.linear()).angle(), max_rotation_error_rad) << i;
    }
  }

  template <typename T>
  [[nodiscard]] std::optional<T> sample(const dds::TopicSpec<T>& topic) {
    dds::Reader<T> reader(*participant_, topic.dds_name, topic.reader);
    T message;
    return reader.take(message, {}, patience) ? std::optional(message) : std::nullopt;
  }

  ServiceSetup setup_;
  dds::Topics topics_ = dds::Topics::in("stillmap");
  std::optional<ServerProcess> server_;
  std::optional<Client> client_;
  std::optional<dds::Participant> participant_;
  std::optional<ScanPublisher> publisher_;
  std::mutex mutex_;
  std::map<std::int64_t, OdometryUpdate> updates_;
  Subscription odometry_;
};

}  // namespace stillmap::test
