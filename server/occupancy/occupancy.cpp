#include "server/occupancy/occupancy.hpp"

#include "idl/conversions/octomap.hpp"

namespace stillmap::server {

OctomapPublisher::OctomapPublisher(dds::Participant& participant, const dds::Topics& topics,
                                   const ServerConfig& config, OccupancyThread& occupancy)
    : occupancy_(occupancy),
      map_frame_(config.frames.map),
      writer_(participant, topics.octomap.dds_name, topics.octomap.writer),
      thread_(std::chrono::duration<double>(config.occupancy.publish_period_s),
              [this] { publish(); }) {}

void OctomapPublisher::publish() {
  // A whole octree is not worth encoding for nobody; who joins later gets it within a period.
  if (writer_.readers().count() == 0) return;
  const std::uint64_t changes = occupancy_.changes();
  if (changes == published_) return;
  published_ = changes;
  // Encoding takes long, and poses come first.
  const EncodedOctree octree = occupancy_.encode_in_background().get();
  // Keep-last writers always have room.
  static_cast<void>(writer_.write(wire::to_octomap(octree.data, octree.stamp_ns, map_frame_)));
}

}  // namespace stillmap::server
