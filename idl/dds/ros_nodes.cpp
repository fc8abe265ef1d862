#include "idl/dds/ros_nodes.hpp"

#include <algorithm>
#include <sstream>
#include <utility>

#include "idl/dds/ros_graph.hpp"
#include "idl/dds/shown_text.hpp"
#include "rmw_dds_common.h"
#include "rmw_dds_common_iron.h"

namespace stillmap::dds {
namespace {

// Announcements between two looks; each process announces its endpoints as they come.
constexpr int max_waiting_announcements = 1000;

// A node has some 100 bytes, and 24 for each of its endpoints; in memory its names alone have 512.
constexpr std::size_t max_announcement_bytes = 1'000'000;

// Of a namespace and a node.
constexpr std::size_t max_name_bytes = 512;

/// Nothing when the bytes are a sample of another layout.
template <typename Info>
std::vector<std::string> names_in(SerializedSample& announcement) {
  constexpr std::size_t alignment = 4;
  const auto type = type_support<Info>();
  Info info;
  if (!from_bytes(type, announcement, &info)) return {};
  // The other layout may be readable, too, but not to its end.
  const std::size_t read_bytes = to_bytes(type, &info, 0).size();
  if (read_bytes > announcement.size() || announcement.size() - read_bytes >= alignment) return {};
  std::vector<std::string> names;
  for (const auto& node : info.node_entities_info_seq()) {
    const std::string name_space = node.node_namespace().to_string();
    names.push_back(shown_text(
        name_space + (name_space.ends_with('/') ? "" : "/") + node.node_name().to_string(),
        max_name_bytes));
  }
  return names;
}

}  // namespace

std::vector<std::string> ros_node_names(SerializedSample announcement) {
  if (announcement.size() > max_announcement_bytes) return {};
  auto names = names_in<rmw_dds_common::msg::ParticipantEntitiesInfo>(announcement);
  if (!names.empty()) return names;
  return names_in<rmw_dds_common_iron::msg::ParticipantEntitiesInfo>(announcement);
}

RosNodes::RosNodes(Participant& participant)
    : reader_(participant, ros_discovery_topic, ros_discovery_type,
              {.transient_local = true, .depth = max_waiting_announcements}) {}

void RosNodes::take_announcements() {
  SerializedSample announcement;
  eprosima::fastdds::dds::SampleInfo info;
  while (reader_.take(announcement, info, {}, std::chrono::milliseconds(0))) {
    std::ostringstream guid;
    guid << info.sample_identity.writer_guid().guidPrefix;
    nodes_[guid.str()] = ros_node_names(std::move(announcement));
  }
}

void RosNodes::add_to(std::vector<RemoteParticipant>& participants) {
  const std::scoped_lock lock(mutex_);
  take_announcements();
  std::erase_if(nodes_, [&](const auto& known) {
    return std::ranges::find(participants, known.first, &RemoteParticipant::guid) ==
           participants.end();
  });
  for (RemoteParticipant& participant : participants) {
    const auto known = nodes_.find(participant.guid);
    if (known != nodes_.end()) participant.ros_nodes = known->second;
  }
}

}  // namespace stillmap::dds
