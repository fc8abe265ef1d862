#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "clients/terminal/command_line.hpp"

namespace stillmap::cli {

/// How a command line says where a lidar sits on its robot.
struct MountArguments {
  /// x, y, z [m], roll, pitch, yaw [deg]; empty: not given.
  std::vector<double> xyz_rpy;

  /// T_base_lidar; nothing where it is not given. Throws std::invalid_argument.
  [[nodiscard]] std::optional<Eigen::Isometry3d> T_base_lidar() const;
};

/// What the poses of a run are of.
struct MappedBody {
  std::string frame = "lidar";
  /// Where the lidar sits on it. The map begins where the body stands.
  Eigen::Isometry3d T_body_lidar = Eigen::Isometry3d::Identity();
};

/// The robot, where the command line or the server's file (empty: none) says where its lidar sits,
/// else the lidar. Throws std::invalid_argument for a file of several lidars, or one that takes the
/// place from /tf_static, and ConfigError.
[[nodiscard]] MappedBody body_of(const MountArguments& mount, const std::string& config_file);

/// Adds --mount; `help` says what it is for.
OptionHandle add_mount_option(CommandHandle command, MountArguments& arguments,
                              const std::string& help);

/// Adds an option for the name of a frame. A '/' at its front, with which tf2 looks up none, is
/// taken away.
OptionHandle add_frame_option(CommandHandle command, const std::string& option, std::string& frame,
                              const std::string& help);

}  // namespace stillmap::cli
