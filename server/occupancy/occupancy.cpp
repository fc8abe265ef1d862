#include "server/occupancy/occupancy.hpp"

#include <algorithm>
#include <utility>

#include "idl/conversions/occupancy.hpp"

namespace stillmap::server {

namespace {

// How soon a reader that joins, and another map, are noticed.
constexpr std::chrono::duration<double> poll_period{0.1};
// However many readers join.
constexpr std::chrono::duration<double> min_period{1.0};

}  // namespace

OctomapPublisher::OctomapPublisher(dds::Participant& participant, const dds::Topics& topics,
                                   const ServerConfig& config, OccupancyThread& occupancy)
    : occupancy_(occupancy),
      map_frame_(config.frames.map),
      period_(config.occupancy.publish_period_s),
      writer_(participant, topics.octomap.dds_name, topics.octomap.writer),
      worker_("octomap", std::min(poll_period, period_),
              [this](const std::stop_token&) { publish_when_due(); }) {}

void OctomapPublisher::publish_when_due() {
  if (const std::uint64_t map = occupancy_.maps_begun(); map != map_) {
    map_ = map;
    is_urgent_ = true;
    forget_published();
  }
  const int readers = writer_.readers().count();
  if (readers > std::exchange(readers_, readers)) is_urgent_ = true;
  const bool has_changed = occupancy_.changes() != published_;
  // Encoding a whole octree without a reader would be wasted.
  if (readers == 0 && has_changed) forget_published();
  if (encoding_.valid()) return publish_when_encoded();
  if (readers == 0 || !has_changed || !is_due()) return;
  encoding_changes_ = occupancy_.changes();
  encoding_map_ = map_;
  // On the octree's thread of idle priority: it must not delay poses.
  encoding_ = occupancy_.encode_in_background();
}

bool OctomapPublisher::is_due() {
  const auto period = is_urgent_ ? std::min(min_period, period_) : period_;
  const auto now = std::chrono::steady_clock::now();
  if (now - last_ < period) return false;
  is_urgent_ = false;
  last_ = now;
  return true;
}

void OctomapPublisher::forget_published() {
  if (published_ != 0) writer_.forget_written();
  published_ = 0;
}

void OctomapPublisher::publish_when_encoded() {
  if (encoding_.wait_for(std::chrono::seconds(0)) != std::future_status::ready) return;
  const EncodedOctree octree = encoding_.get();
  if (encoding_map_ != map_) return;
  published_ = encoding_changes_;
  // Keep-last writers always have room.
  static_cast<void>(writer_.write(wire::to_octomap(octree.data, octree.stamp_ns, map_frame_)));
}

Occupancy::Occupancy(dds::Participant& participant, const dds::Topics& topics,
                     const ServerConfig& config, Statistics& statistics, ThrottleCallback throttle)
    : thread_(config.occupancy, statistics, std::move(throttle),
              config.input.delivery == DeliveryMode::every ? BackgroundScheduling::normal
                                                           : BackgroundScheduling::idle,
              config.input.delivery),
      publisher_(participant, topics, config, thread_) {}

}  // namespace stillmap::server
