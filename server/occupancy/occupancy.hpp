#pragma once

#include <chrono>
#include <cstdint>
#include <future>
#include <string>

#include "config/loaders/server_config.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "octomap_msgs.h"
#include "server/occupancy/occupancy_thread.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Publishes the octree (binary, as RViz2's plug-in and octomap_server's clients read it) when it
/// has changed and has a reader: every period, and at once to a reader that joins. Nothing is kept
/// for late joiners that is older than the last reader, or of a map that is no more.
class OctomapPublisher {
 public:
  OctomapPublisher(dds::Participant& participant, const dds::Topics& topics,
                   const ServerConfig& config, OccupancyThread& occupancy);

 private:
  void publish_when_due();
  [[nodiscard]] bool is_due();
  void forget_published();
  void publish_when_encoded();

  OccupancyThread& occupancy_;
  std::string map_frame_;
  std::chrono::duration<double> period_;
  /// OccupancyThread::changes() of what is kept for late joiners; 0: nothing is.
  std::uint64_t published_ = 0;
  std::uint64_t map_ = 0;
  /// The octree that is being encoded, which may take long; the changes and the map in it.
  std::future<EncodedOctree> encoding_;
  std::uint64_t encoding_changes_ = 0;
  std::uint64_t encoding_map_ = 0;
  int readers_ = 0;
  bool is_urgent_ = false;
  std::chrono::steady_clock::time_point last_;
  dds::Writer<octomap_msgs::msg::Octomap> writer_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

/// The octree and its topic.
class Occupancy {
 public:
  Occupancy(dds::Participant& participant, const dds::Topics& topics, const ServerConfig& config,
            Statistics& statistics, ThrottleCallback throttle);

  [[nodiscard]] OccupancyThread& thread() { return thread_; }

 private:
  OccupancyThread thread_;
  OctomapPublisher publisher_;
};

}  // namespace stillmap::server
