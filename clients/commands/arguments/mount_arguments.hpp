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

/// Adds --mount; `help` says what it is for.
void add_mount_option(CommandHandle command, MountArguments& arguments, const std::string& help);

}  // namespace stillmap::cli
