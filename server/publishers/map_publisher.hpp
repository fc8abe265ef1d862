#pragma once

#include <string>

#include "config/loaders/server_config.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "sensor_msgs.h"
#include "server/publishers/latest_map.hpp"
#include "server/publishers/periodic_thread.hpp"
#include "server/publishers/tile_publisher.hpp"

namespace stillmap {

/// Publishes what is heavy and not urgent, each from its own thread and only when it changed:
/// tiles, the path, and the static map round the robot.
class MapPublisher {
 public:
  MapPublisher(Participant& participant, const Topics& topics, const ServerConfig& config,
               const MapBoard& board);

 private:
  /// Changes with every pose, and when a map was loaded.
  struct PathState {
    std::uint64_t map_id = 0;
    std::uint64_t poses = 0;
    friend bool operator==(const PathState&, const PathState&) = default;
  };
  /// Whether there is a path, and another one than `shown`, which then becomes it.
  [[nodiscard]] bool is_news(PathState& shown) const;

  void publish_path();
  void publish_cloud();

  const MapBoard& board_;
  std::string map_frame_;
  std::size_t path_poses_;
  float half_window_m_;
  PathState shown_path_;
  PathState shown_cloud_;
  TilePublisher tiles_;
  Writer<nav_msgs::msg::Path> path_;
  Writer<sensor_msgs::msg::PointCloud2> cloud_;
  // Last: they stop before what they use is gone.
  PeriodicThread tile_thread_;
  PeriodicThread path_thread_;
  PeriodicThread cloud_thread_;
};

}  // namespace stillmap
