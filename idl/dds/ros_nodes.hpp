#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "idl/dds/remote_participant.hpp"
#include "idl/dds/serialized_sample.hpp"

namespace stillmap::dds {

/// Names of the nodes that a sample of ros_discovery_info announces ("/rviz2"), whether its GIDs
/// have 24 bytes (up to ROS 2 Humble) or 16; none when it is no such sample, or has more
/// than 1 MB.
[[nodiscard]] std::vector<std::string> ros_node_names(SerializedSample announcement);

/// Which ROS 2 nodes the participants of the domain hold, as they announce it: ROS 2 gives its
/// participants no names of their own. Thread-safe.
class RosNodes {
 public:
  /// Throws DdsError, NotPermitted where our identity may not read the announcements.
  explicit RosNodes(Participant& participant);

  /// Adds what came until now to these participants, and forgets those that are not among them.
  void add_to(std::vector<RemoteParticipant>& participants);

 private:
  void take_announcements();

  std::mutex mutex_;
  /// By RemoteParticipant::guid.
  std::map<std::string, std::vector<std::string>> nodes_;
  SerializedSampleReader reader_;
};

}  // namespace stillmap::dds
