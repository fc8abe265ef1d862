#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/dds/security/documents.hpp"

namespace stillmap::dds {

/// What an identity of a secured domain is for.
enum class Role {
  /// Everything that stillmap-server reads, publishes and answers.
  server,
  /// Publishes scans and the odometry prior, and reads what the server publishes.
  sensor,
  /// Reads every topic, and calls the services that change nothing.
  planner,
  /// A planner that may also reset, save, load and restore, and say where the robot is.
  operator_of_server,
};

[[nodiscard]] std::string_view name(Role role);
/// Nothing for other names.
[[nodiscard]] std::optional<Role> role_from_name(std::string_view name);
/// "server, sensor, planner, operator".
[[nodiscard]] const std::string& role_names();

/// Names that a deployment chooses: ROS 2 names, as in the server's configuration.
struct TopicNames {
  /// Of every lidar's clouds.
  std::vector<std::string> points{"points"};
  /// Empty: none.
  std::string odometry_prior = "odom_prior";
  /// Empty: none.
  std::string imu = "imu/data";
  std::string gnss = "fix";
  /// Empty: none.
  std::string initial_pose = "initialpose";
  std::string name_space = "stillmap";
};

/// DDS names of everything that the server publishes.
[[nodiscard]] std::vector<std::string> published_topics(const std::string& name_space);

/// What a role may do: derived from the tables of topics and services.
[[nodiscard]] Access access_of(Role role, const TopicNames& names);

}  // namespace stillmap::dds
