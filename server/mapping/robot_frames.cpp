#include "server/mapping/robot_frames.hpp"

#include <spdlog/spdlog.h>

#include <string_view>
#include <utility>

#include "server/monitoring/shown_name.hpp"

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;

// Less is the rounding of a quaternion, not another place.
constexpr double same_mount = 1e-6;

// tf2 knows none with a '/' at its front, which drivers of old send.
std::string_view tf2_name(std::string_view frame) {
  return frame.substr(frame.starts_with('/') ? 1 : 0);
}

}  // namespace

RobotFrames::RobotFrames(const ServerConfig& config, const StaticTransforms* static_transforms,
                         Statistics& statistics)
    : frames_(config.frames),
      mount_(config.mount),
      waits_(config.input.delivery == DeliveryMode::every),
      static_transforms_(static_transforms),
      statistics_(statistics),
      T_base_lidar_(config.mount.T_base_lidar) {}

bool RobotFrames::locate_lidar(const std::string& cloud_frame, bool map_begins) {
  const std::string& lidar = frames_.lidar.empty() ? cloud_frame : frames_.lidar;
  const bool is_other = lidar != lidar_;
  const bool is_configured = mount_.source == MountConfig::Source::configuration;
  other_lidar_.clear();
  if (is_located_ && is_other && !map_begins && !is_configured) {
    other_lidar_ = lidar;
    return false;
  }
  cloud_frame_ = cloud_frame;
  lidar_ = lidar;
  if (is_configured) return true;
  if (is_other) is_located_ = false;
  const std::optional<Eigen::Isometry3d> T_base_lidar = published_mount();
  if (!T_base_lidar) return is_located_;
  if (is_located_ && !map_begins) {
    if (T_base_lidar->isApprox(T_base_lidar_, same_mount)) return true;
    statistics_.count("mount_changed");
    throttled_log_.warn("mount", "/tf_static now has another transform " + frames_.base + " -> " +
                                     shown_name(lidar_) +
                                     ": it counts from the next map on ('stillmap reset')");
    return true;
  }
  T_base_lidar_ = *T_base_lidar;
  is_located_ = true;
  return true;
}

std::optional<Eigen::Isometry3d> RobotFrames::published_mount() {
  const bool may_wait = waits_ && !missed_ && !is_located_;
  const std::chrono::duration<double> wait(may_wait ? mount_.wait_s : 0.0);
  const auto began = Clock::now();
  if (static_transforms_ != nullptr) {
    const auto found = static_transforms_->wait_for(frames_.base, lidar_, wait);
    if (found) return found;
  }
  if (!missed_) missed_ = began;
  const std::chrono::duration<double> missed_for = Clock::now() - *missed_;
  if (is_located_ || missed_for.count() < mount_.wait_s) return std::nullopt;
  statistics_.count("mount_missing");
  const std::string outcome = mount_.identity_if_missing
                                  ? "; mapping as if the lidar were the base (mount.if_missing)"
                                  : "; scans are dropped until it comes";
  throttled_log_.warn("mount_missing", missing() + outcome);
  if (!mount_.identity_if_missing) return std::nullopt;
  return Eigen::Isometry3d(Eigen::Isometry3d::Identity());
}

std::string RobotFrames::missing() const {
  if (!other_lidar_.empty()) {
    return "the map is made of clouds of '" + shown_name(lidar_) + "', and these are of '" +
           shown_name(other_lidar_) +
           "': give each lidar a topic of its own, or list both under 'sensors'";
  }
  std::string text = "no transform " + frames_.base + " -> " + shown_name(lidar_) +
                     " on /tf_static; frames there: " +
                     (static_transforms_ ? static_transforms_->known_frames() : "none");
  if (lidar_ != cloud_frame_) {
    text += "; the clouds name '" + shown_name(cloud_frame_) + "': frames.lidar: \"\" takes that";
  }
  return text +
         "; publish it (robot_state_publisher, static_transform_publisher), or set mount: "
         "{source: configuration, xyz_m, rpy_deg}";
}

std::optional<Eigen::Isometry3d> RobotFrames::T_lidar_frame(const std::string& frame) const {
  const Eigen::Isometry3d T_lidar_base = T_base_lidar_.inverse();
  if (frame.empty()) return std::nullopt;
  if (has_base() && frame == frames_.base) return T_lidar_base;
  const std::string_view name = tf2_name(frame);
  if (name == tf2_name(lidar_) || name == tf2_name(cloud_frame_))
    return Eigen::Isometry3d::Identity();
  if (static_transforms_ == nullptr) return std::nullopt;
  const auto T_base_frame = static_transforms_->find(frames_.base, frame);
  if (!T_base_frame) return std::nullopt;
  return T_lidar_base * *T_base_frame;
}

}  // namespace stillmap::server
