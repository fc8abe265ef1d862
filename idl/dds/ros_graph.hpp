#pragma once

#include <fastdds/rtps/common/Guid.h>

#include <vector>

#include "idl/dds/participant.hpp"

namespace stillmap::dds {

/// DDS name of the topic where ROS 2 nodes announce their endpoints.
inline constexpr const char* ros_discovery_topic = "ros_discovery_info";
/// DDS name of its type, of which there are two layouts: peers of both may be in one domain, so its
/// samples are handled as bytes.
inline constexpr const char* ros_discovery_type =
    "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// Tells ROS 2 which readers and writers belong to this node (topic ros_discovery_info), so that
/// `ros2 node info` shows them. Not thread-safe; the participant guards it.
class RosGraph {
 public:
  using Guid = eprosima::fastrtps::rtps::GUID_t;

  /// Throws DdsError when the announcing writer cannot be made.
  RosGraph(Participant& participant, const Guid& participant_guid);

  void add_reader(const Guid& reader);
  void add_writer(const Guid& writer);
  void remove(const Guid& endpoint);

 private:
  void announce();
  template <typename Info>
  void announce_as();

  Guid participant_guid_;
  std::string node_name_;
  std::uint32_t gid_bytes_;
  std::vector<Guid> readers_;
  std::vector<Guid> writers_;
  Participant::WriterHandle writer_;
};

}  // namespace stillmap::dds
