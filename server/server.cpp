#include "server/server.hpp"

#include <spdlog/spdlog.h>

#include <utility>

namespace stillmap::server {
namespace {

dds::DdsOptions server_options(const DdsConfig& config) {
  dds::DdsOptions options = dds_options(config.network, DdsRole::server);
  options.domain_id = config.domain_id;
  options.node_name = config.participant_name;
  options.ros_gid_bytes = config.ros_gid_bytes;
  options.security = config.security;
  return options;
}

ThrottleCallback throttle_callback(const ServerConfig& config, const BackgroundThrottle& throttle,
                                   SaturationPolicy saturation_policy) {
  // When every scan is to be mapped, poses may be late, and background work need not wait.
  if (config.input.delivery == DeliveryMode::every) return {};
  return make_throttle_callback(throttle, saturation_policy);
}

}  // namespace

Server::Server(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter)
    : service_log_(statistics_.metrics()),
      storage_(config, segmenter->name(), statistics_),
      topics_(dds::Topics::in(config.topics.name_space)),
      participant_(server_options(config.dds)),
      // An octree that misses scans is better than late poses.
      occupancy_(config.occupancy.enabled
                     ? std::make_optional<Occupancy>(
                           participant_, topics_, config, statistics_,
                           throttle_callback(config, throttle_, SaturationPolicy::wait))
                     : std::nullopt),
      mapping_(config, std::move(segmenter),
               {.storage = storage_,
                .participant = participant_,
                .topics = topics_,
                .statistics = statistics_,
                .throttle = throttle_,
                .occupancy = occupancy_ ? &occupancy_->thread() : nullptr}),
      traversability_(config, participant_, topics_, storage_.latest_map(), storage_.tiles(),
                      statistics_,
                      throttle_callback(config, throttle_, SaturationPolicy::run_at_ten_percent)),
      interface_(config, {.participant = participant_,
                          .topics = topics_,
                          .statistics = statistics_,
                          .service_log = service_log_,
                          .storage = storage_,
                          .mapping = mapping_,
                          .traversability = traversability_,
                          .occupancy = occupancy_ ? &occupancy_->thread() : nullptr}) {
  if (config.metrics.address.empty()) return;
  metrics_.emplace(config.metrics.address, statistics_.metrics(),
                   [this] { return interface_.status(); });
  spdlog::info("metrics: http://{}/metrics", metrics_->address());
}

// Requests and scans wait for the mapping thread: they end first, so that none waits for a thread
// that has ended. Traversability gets processor time only between scans, so it ends after them.
// The map is saved when nothing can change it any more; the topics are closed after that, by the
// destructors.
void Server::stop() {
  throttle_.release();
  metrics_.reset();
  interface_.stop();
  traversability_.stop();
  mapping_.stop();
}

}  // namespace stillmap::server
