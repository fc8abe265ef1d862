#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "config/loaders/server_config.hpp"
#include "server/mapping/static_transforms.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// Which frames the robot has, and where its lidar sits. Used by the thread that maps.
class RobotFrames {
 public:
  /// `static_transforms` is null where nothing listens to /tf_static.
  RobotFrames(const ServerConfig& config, const StaticTransforms* static_transforms,
              Statistics& statistics);

  /// Finds the lidar of a cloud on the robot. While a map grows it stays where it was, so that
  /// poses do not jump. False while it is not known: `missing()` says what to do.
  [[nodiscard]] bool locate_lidar(const std::string& cloud_frame, bool map_begins);
  [[nodiscard]] std::string missing() const;

  /// The lidar's frame on the wire.
  [[nodiscard]] const std::string& lidar() const { return lidar_; }
  /// The frame whose poses are published: the lidar's where no base is configured.
  [[nodiscard]] const std::string& base() const { return has_base() ? frames_.base : lidar_; }
  [[nodiscard]] bool has_base() const { return !frames_.base.empty(); }
  /// Whether the lidar's place is in the configuration, and nobody else publishes it.
  [[nodiscard]] bool is_configured() const {
    return mount_.source == MountConfig::Source::configuration;
  }
  [[nodiscard]] const Eigen::Isometry3d& T_base_lidar() const { return T_base_lidar_; }

  /// Where a frame sits at the lidar; nothing for frames that are not known to be on the robot.
  [[nodiscard]] std::optional<Eigen::Isometry3d> T_lidar_frame(const std::string& frame) const;

 private:
  [[nodiscard]] std::optional<Eigen::Isometry3d> published_mount();

  FramesConfig frames_;
  MountConfig mount_;
  /// With delivery `every` no scan may be lost: the first one waits for the transform.
  bool waits_;
  const StaticTransforms* static_transforms_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  std::string cloud_frame_;
  std::string lidar_;
  /// Of the cloud that was refused last, where the map is made of another lidar's; else empty.
  std::string other_lidar_;
  Eigen::Isometry3d T_base_lidar_ = Eigen::Isometry3d::Identity();
  bool is_located_ = false;
  /// When the transform was first missed.
  std::optional<std::chrono::steady_clock::time_point> missed_;
};

}  // namespace stillmap::server
