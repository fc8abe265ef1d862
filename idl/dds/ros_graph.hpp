#pragma once

#include <fastdds/rtps/common/Guid.h>

#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "idl/dds/participant.hpp"
#include "idl/dds/ros_gids.hpp"

namespace stillmap::dds {

class DiscoveryMonitor;

/// Tells ROS 2 which readers and writers belong to this node (topic ros_discovery_info), so that
/// `ros2 node info` shows them; in the layout that the nodes in the domain read, and nothing before
/// the first of them is known. Thread-safe.
class RosGraph {
 public:
  using Guid = eprosima::fastrtps::rtps::GUID_t;

  /// Throws DdsError when the announcing writer cannot be made. The monitor must outlive the graph.
  RosGraph(Participant& participant, DiscoveryMonitor& monitor, const Guid& participant_guid);
  ~RosGraph();
  RosGraph(const RosGraph&) = delete;
  RosGraph& operator=(const RosGraph&) = delete;

  void add_reader(const Guid& reader);
  void add_writer(const Guid& writer);
  void remove(const Guid& endpoint);

 private:
  /// Announces in another layout once ROS 2 nodes come that read it.
  void follow_peers(const std::stop_token& stop);
  void wake_follower();
  // With the mutex held.
  void announce();
  template <typename Info>
  void announce_as();

  DiscoveryMonitor& monitor_;
  Guid participant_guid_;
  std::string node_name_;
  std::mutex mutex_;
  std::optional<RosGids> layout_;
  std::vector<Guid> readers_;
  std::vector<Guid> writers_;
  Participant::WriterHandle writer_;
  std::mutex wake_mutex_;
  std::condition_variable_any wake_;
  bool peers_changed_ = false;
  // Last: stops before what it uses is gone.
  std::jthread follower_;
};

}  // namespace stillmap::dds
