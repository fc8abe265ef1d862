#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "config/loaders/server_config.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "sensor_msgs.h"
#include "server/monitoring/log.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/publishers/tile_publisher.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Publishes the large and less urgent topics, each from its own thread and only when it changed:
/// tiles, the path, and a cloud of the static map round the robot.
class MapPublisher {
 public:
  MapPublisher(dds::Participant& participant, const dds::Topics& topics, const ServerConfig& config,
               const LatestMap& latest_map, TileReader& tiles);

 private:
  /// Changes with every pose, and when a map was loaded or corrected.
  struct PathState {
    std::uint64_t map_id = 0;
    std::uint64_t poses = 0;
    std::uint64_t corrections = 0;
    /// Of the view, where that is published, too.
    std::uint64_t version = 0;
    friend bool operator==(const PathState&, const PathState&) = default;
  };
  /// Whether there is another path than `published`, which then becomes it; none is another one
  /// where there was one: who comes late would be shown the path of the map before.
  /// `with_view`: or another view along it.
  [[nodiscard]] bool has_changed(PathState& published, bool with_view) const;

  void publish_tiles();
  void publish_path();
  void publish_cloud();
  /// The view, with the voxels of the tiles in the window. False where some cannot be read now.
  [[nodiscard]] bool read_window(MapSnapshot& view, const Eigen::AlignedBox2f& window_map);

  const LatestMap& latest_map_;
  std::string map_frame_;
  std::size_t path_poses_;
  float half_window_m_;
  PathState published_path_;
  PathState published_cloud_;
  /// When tiles that could not be read are tried again.
  std::optional<std::chrono::steady_clock::time_point> retry_cloud_;
  ThrottledLog throttled_log_;
  TileReader& reader_;
  TilePublisher tiles_;
  dds::Writer<nav_msgs::msg::Path> path_;
  dds::Writer<sensor_msgs::msg::PointCloud2> cloud_;
  // Last: they stop before what they use is gone.
  PeriodicWorker tile_worker_;
  PeriodicWorker path_worker_;
  PeriodicWorker cloud_worker_;
};

}  // namespace stillmap::server
