#include "server/occupancy/occupancy.hpp"

#include <utility>

#include "idl/conversions/occupancy.hpp"

namespace stillmap::server {

OctomapPublisher::OctomapPublisher(dds::Participant& participant, const dds::Topics& topics,
                                   const ServerConfig& config, OccupancyThread& occupancy)
    : occupancy_(occupancy),
      map_frame_(config.frames.map),
      writer_(participant, topics.octomap.dds_name, topics.octomap.writer),
      worker_(std::chrono::duration<double>(config.occupancy.publish_period_s),
              [this](const std::stop_token&) { publish(); }) {}

void OctomapPublisher::publish() {
  // Encoding a whole octree without a reader would be wasted; a late joiner gets it within a
  // period.
  if (writer_.readers().count() == 0) return;
  const std::uint64_t changes = occupancy_.changes();
  if (changes == published_) return;
  published_ = changes;
  // On the octree's thread of idle priority: encoding takes long and must not delay poses.
  const EncodedOctree octree = occupancy_.encode_in_background().get();
  // Keep-last writers always have room.
  static_cast<void>(writer_.write(wire::to_octomap(octree.data, octree.stamp_ns, map_frame_)));
}

Occupancy::Occupancy(dds::Participant& participant, const dds::Topics& topics,
                     const ServerConfig& config, Statistics& statistics, ThrottleCallback throttle)
    : thread_(config.occupancy, statistics, std::move(throttle)),
      publisher_(participant, topics, config, thread_) {}

}  // namespace stillmap::server
