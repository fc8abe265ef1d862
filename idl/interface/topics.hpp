#pragma once

#include <cstdint>
#include <string>

#include "idl/dds/topic_qos.hpp"
#include "idl/interface/server_status.hpp"
#include "idl/msg/wire_types.hpp"

namespace stillmap::dds {

/// Version of every struct in stillmap_msgs.idl that carries one.
inline constexpr std::uint8_t wire_format_version = 8;

/// A topic: its name as DDS sees it, its type, and the quality of service of its writer and
/// readers.
template <typename T>
struct TopicSpec {
  std::string dds_name;
  TopicQos writer;
  TopicQos reader;
};

/// Every topic that carries data. ROS 2 names them without "rt/". Writers offer reliable delivery,
/// which matches readers of both kinds; what late joiners need is transient local.
struct Topics {
  TopicSpec<nav_msgs::msg::Odometry> odometry;
  /// As `odometry`, in the frame odom, where it never jumps.
  TopicSpec<nav_msgs::msg::Odometry> local_odometry;
  TopicSpec<tf2_msgs::msg::TFMessage> tf;
  TopicSpec<tf2_msgs::msg::TFMessage> tf_static;
  TopicSpec<nav_msgs::msg::Path> path;
  TopicSpec<sensor_msgs::msg::PointCloud2> scan;
  TopicSpec<sensor_msgs::msg::PointCloud2> static_cloud;
  /// Keyed by tile id, as `tiles`.
  TopicSpec<stillmap_msgs::msg::TileInfo> tile_index;
  TopicSpec<stillmap_msgs::msg::MapTile> tiles;
  TopicSpec<stillmap_msgs::msg::Status> status;
  TopicSpec<octomap_msgs::msg::Octomap> octomap;
  /// What loop closing moves, after each time that it did, and when one is added.
  TopicSpec<stillmap_msgs::msg::SubmapList> submaps;
  /// Where the robot of `traversability.grid_profile` can go.
  TopicSpec<nav_msgs::msg::OccupancyGrid> traversability;

  /// `name_space` is the first part of all names but those of tf: "stillmap" gives
  /// rt/stillmap/odometry.
  [[nodiscard]] static Topics in(const std::string& name_space);
};

/// Calls visit(topic) for each of the server's topics.
template <typename Visit>
void for_each_topic(const Topics& topics, Visit&& visit) {
  // Every field by name: one more in Topics, and this does not compile.
  const auto& [odometry, local_odometry, tf, tf_static, path, scan, static_cloud, tile_index, tiles,
               status, octomap, submaps, traversability] = topics;
  const auto visit_all = [&](const auto&... topic) { (visit(topic), ...); };
  visit_all(odometry, local_odometry, tf, tf_static, path, scan, static_cloud, tile_index, tiles,
            status, octomap, submaps, traversability);
}

/// Incoming scans as the server reads them: reliably from whoever offers that, since large samples
/// get lost even on one machine. With `every`, a publisher must offer it, and waits when
/// `queue_length` are not taken yet; with `latest`, it never waits.
[[nodiscard]] TopicSpec<sensor_msgs::msg::PointCloud2> points_topic(const std::string& ros_name,
                                                                    DeliveryMode delivery,
                                                                    int queue_length);

/// The odometry prior (nav_msgs/Odometry) as the server reads it.
[[nodiscard]] TopicSpec<nav_msgs::msg::Odometry> odometry_prior_topic(const std::string& ros_name);

/// The pose that an operator sets (geometry_msgs/PoseWithCovarianceStamped), as RViz2 and Nav2
/// write it and the server reads it.
[[nodiscard]] TopicSpec<geometry_msgs::msg::PoseWithCovarianceStamped> initial_pose_topic(
    const std::string& ros_name);

/// Samples of the IMU (sensor_msgs/Imu) as the server reads them: a publisher that waits for the
/// server's scans (`every`) is to wait for its samples, too.
[[nodiscard]] TopicSpec<sensor_msgs::msg::Imu> imu_topic(const std::string& ros_name,
                                                         DeliveryMode delivery);

/// Fixes of a GNSS receiver (sensor_msgs/NavSatFix), likewise.
[[nodiscard]] TopicSpec<sensor_msgs::msg::NavSatFix> gnss_topic(const std::string& ros_name,
                                                                DeliveryMode delivery);

}  // namespace stillmap::dds
