#include "server/publishers/submap_publisher.hpp"

namespace stillmap::server {

SubmapPublisher::SubmapPublisher(dds::Participant& participant, const dds::Topics& topics)
    : writer_(participant, topics.submaps.dds_name, topics.submaps.writer),
      worker_("submaps", newest_,
              [this](const SubmapsOfMap& submaps) {
                // A keep-last writer always has room.
                static_cast<void>(writer_.write(wire::to_wire(submaps)));
              },
              {.finishes_queue = true}) {}

}  // namespace stillmap::server
