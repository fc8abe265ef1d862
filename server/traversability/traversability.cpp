#include "server/traversability/traversability.hpp"

#include <chrono>
#include <utility>

namespace stillmap::server {

Traversability::Traversability(const ServerConfig& config, dds::Participant& participant,
                               const dds::Topics& topics, const LatestMap& latest_map,
                               TileReader& tiles, Statistics& statistics, ThrottleCallback throttle)
    : cache_(snapshot_, latest_map, tiles,
             TraversabilityCache::longest_lag(
                 std::chrono::duration<double>(config.traversability.update_period_s))),
      grid_(config.traversability, config.frames.map, latest_map, snapshot_) {
  std::vector<RobotProfile> robots = load_robots(config.traversability);
  if (robots.empty()) return;
  if (!config.traversability.grid_profile.empty()) {
    publisher_.emplace(participant, topics, grid_);
  }
  const auto publish = [this] {
    if (publisher_) publisher_->publish();
  };
  thread_.emplace(
      std::move(robots),
      FollowedMap{.latest = latest_map,
                  .tiles = tiles,
                  .bytes_on_disk = (std::size_t{config.map.memory_limit_mib} << 20) / 8},
      snapshot_, statistics,
      TraversabilityUpdates{
          .period = std::chrono::duration<double>(config.traversability.update_period_s),
          .updated = publish,
          .throttle = std::move(throttle)});
}

}  // namespace stillmap::server
