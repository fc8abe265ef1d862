#include "idl/interface/topics.hpp"

namespace stillmap::dds {
namespace {

// A map of 20 km by 20 km in tiles of 20 m would be a million; a drive touches some thousands.
constexpr int max_tiles = 200'000;

template <typename T>
TopicSpec<T> symmetric(const std::string& dds_name, const TopicQos& qos) {
  return {.dds_name = dds_name, .writer = qos, .reader = qos};
}

}  // namespace

Topics Topics::in(const std::string& name_space) {
  const std::string prefix = "rt/" + name_space + "/";
  const TopicQos latched{.transient_local = true, .depth = 1};
  const TopicQos large{.transient_local = true, .depth = 1, .large_messages = true};
  const TopicQos keyed{.transient_local = true, .depth = 1, .max_keys = max_tiles};
  const TopicQos large_keyed{
      .transient_local = true, .depth = 1, .max_keys = max_tiles, .large_messages = true};
  // Deep, so that a client that stalls for a minute still gets every pose.
  const TopicQos every_pose{.depth = 1000};
  const TopicQos newest{.reliable = false, .depth = 1, .large_messages = true};
  return {
      .odometry = symmetric<nav_msgs::msg::Odometry>(prefix + "odometry", every_pose),
      .local_odometry = symmetric<nav_msgs::msg::Odometry>(prefix + "local_odometry", every_pose),
      .tf = symmetric<tf2_msgs::msg::TFMessage>("rt/tf", {.depth = 100}),
      // Each node of a robot writes its own transforms once, in one sample.
      .tf_static = {.dds_name = "rt/tf_static",
                    .writer = latched,
                    .reader = {.transient_local = true, .depth = 100}},
      .path = symmetric<nav_msgs::msg::Path>(prefix + "path", large),
      // RViz2 asks for reliable clouds unless it is told otherwise.
      .scan = {.dds_name = prefix + "scan",
               .writer = {.depth = 1, .large_messages = true},
               .reader = newest},
      .static_cloud = symmetric<sensor_msgs::msg::PointCloud2>(prefix + "static_cloud", large),
      .tile_index = symmetric<stillmap_msgs::msg::TileInfo>(prefix + "tile_index", keyed),
      .tiles = symmetric<stillmap_msgs::msg::MapTile>(prefix + "tiles", large_keyed),
      .status = symmetric<stillmap_msgs::msg::Status>(prefix + "status", latched),
      .octomap = symmetric<octomap_msgs::msg::Octomap>(prefix + "octomap", large),
      .submaps = symmetric<stillmap_msgs::msg::SubmapList>(prefix + "submaps", large),
      .traversability = symmetric<nav_msgs::msg::OccupancyGrid>(prefix + "traversability", large),
  };
}

TopicSpec<sensor_msgs::msg::PointCloud2> points_topic(const std::string& ros_name,
                                                      DeliveryMode delivery, int queue_length) {
  const bool every = delivery == DeliveryMode::every;
  return {.dds_name = "rt/" + ros_name,
          .writer = {.depth = queue_length, .keep_all = every},
          .reader = {.accept_best_effort = !every, .depth = queue_length, .keep_all = every}};
}

TopicSpec<nav_msgs::msg::Odometry> odometry_prior_topic(const std::string& ros_name) {
  constexpr int depth = 100;
  return {.dds_name = "rt/" + ros_name,
          .writer = {.reliable = false, .depth = depth},
          .reader = {.accept_best_effort = true, .depth = depth}};
}

TopicSpec<geometry_msgs::msg::PoseWithCovarianceStamped> initial_pose_topic(
    const std::string& ros_name) {
  return symmetric<geometry_msgs::msg::PoseWithCovarianceStamped>("rt/" + ros_name, {.depth = 1});
}

TopicSpec<sensor_msgs::msg::Imu> imu_topic(const std::string& ros_name, DeliveryMode delivery) {
  const bool every = delivery == DeliveryMode::every;
  // A second and more at 400 Hz.
  constexpr int depth = 500;
  return {.dds_name = "rt/" + ros_name,
          .writer = {.depth = depth, .keep_all = every},
          .reader = {.accept_best_effort = !every, .depth = depth, .keep_all = every}};
}

TopicSpec<sensor_msgs::msg::NavSatFix> gnss_topic(const std::string& ros_name,
                                                  DeliveryMode delivery) {
  const bool every = delivery == DeliveryMode::every;
  constexpr int depth = 50;
  return {.dds_name = "rt/" + ros_name,
          .writer = {.depth = depth, .keep_all = every},
          .reader = {.accept_best_effort = !every, .depth = depth, .keep_all = every}};
}

}  // namespace stillmap::dds
