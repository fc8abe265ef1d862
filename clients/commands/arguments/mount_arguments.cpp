#include "clients/commands/arguments/mount_arguments.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "config/loaders/server_config.hpp"
#include "core/frames/rigid_motion.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap::cli {
namespace {

std::string to_frame_name(std::string& frame) {
  const std::string given = frame;
  if (frame.starts_with('/')) frame.erase(0, 1);
  const bool is_name = frame.empty() ? given.empty() : frame.front() != '/';
  return is_name ? "" : "'" + given + "' is no name of a frame; leave the '/' at its front away";
}

}  // namespace

std::optional<Eigen::Isometry3d> MountArguments::T_base_lidar() const {
  if (xyz_rpy.empty()) return std::nullopt;
  constexpr double largest = 1000.0;
  const bool is_usable = std::ranges::all_of(
      xyz_rpy, [](double value) { return std::isfinite(value) && std::abs(value) <= largest; });
  if (!is_usable) {
    throw std::invalid_argument(
        "--mount needs finite numbers: x,y,z in metres, roll,pitch,yaw in "
        "degrees");
  }
  return from_xyz_rpy({xyz_rpy[0], xyz_rpy[1], xyz_rpy[2]},
                      rad_per_deg * Eigen::Vector3d(xyz_rpy[3], xyz_rpy[4], xyz_rpy[5]));
}

MappedBody body_of(const MountArguments& mount, const std::string& file) {
  const ServerConfig server = file.empty() ? ServerConfig{} : load_server_config(file);
  if (!server.lidars.empty()) {
    throw std::invalid_argument(file + " lists several lidars ('sensors'), but a sequence is of " +
                                "one: give a file with 'sensor' and 'mount'");
  }
  const std::string base = server.frames.base.empty() ? "base_link" : server.frames.base;
  if (const auto T_base_lidar = mount.T_base_lidar()) return {base, *T_base_lidar};
  if (server.frames.base.empty()) return {};
  if (server.mount.source == MountConfig::Source::tf_static) {
    throw std::invalid_argument(file +
                                " takes the lidar's place from /tf_static, which a sequence "
                                "does not have: give it with --mount");
  }
  return {base, server.mount.T_base_lidar};
}

OptionHandle add_mount_option(CommandHandle command, MountArguments& arguments,
                              const std::string& help) {
  return command
      .option("--mount", arguments.xyz_rpy,
              help + ": x,y,z [m],roll,pitch,yaw [deg] of the lidar on the robot, as in a URDF")
      .exactly(6)
      .comma_separated();
}

OptionHandle add_frame_option(CommandHandle command, const std::string& option, std::string& frame,
                              const std::string& help) {
  return command.option(option, frame, help).corrected(to_frame_name).with_default();
}

}  // namespace stillmap::cli
