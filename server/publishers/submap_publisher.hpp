#pragma once

#include <utility>

#include "idl/conversions/submaps.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "server/threads/worker.hpp"
#include "submaps.h"

namespace stillmap::server {

/// Publishes the submaps of the running map from a thread of its own; while they are being written,
/// only the newest of the next ones is kept.
class SubmapPublisher {
 public:
  SubmapPublisher(dds::Participant& participant, const dds::Topics& topics);

  /// Returns at once.
  void publish(SubmapsOfMap submaps) { newest_.push_dropping_oldest(std::move(submaps)); }

 private:
  dds::Writer<stillmap_msgs::msg::SubmapList> writer_;
  BoundedQueue<SubmapsOfMap> newest_{1};
  // Last: stops before what it uses is gone.
  Worker<SubmapsOfMap> worker_;
};

}  // namespace stillmap::server
