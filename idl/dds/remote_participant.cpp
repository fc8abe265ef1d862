#include "idl/dds/remote_participant.hpp"

#include <algorithm>
#include <array>

namespace stillmap::dds {
namespace {

void add_part(std::string& text, const std::string& part) {
  if (part.empty()) return;
  if (!text.empty()) text += ", ";
  text += part;
}

}  // namespace

const char* name(Durability durability) {
  constexpr std::array names{"volatile", "transient local", "transient", "persistent"};
  return names.at(static_cast<std::size_t>(durability));
}

std::string describe_location(const RemoteParticipant& peer) {
  std::string text = peer.is_on_this_host ? "this host" : peer.host;
  if (!peer.process.empty()) add_part(text, "process " + peer.process);
  if (!peer.user.empty()) add_part(text, "user " + peer.user);
  if (!peer.addresses.empty()) add_part(text, peer.addresses.front());
  return text;
}

std::string display_name(const RemoteParticipant& peer) {
  constexpr std::size_t max_names = 3;
  std::string text;
  for (std::size_t i = 0; i < std::min(max_names, peer.ros_nodes.size()); ++i) {
    add_part(text, peer.ros_nodes[i]);
  }
  if (peer.ros_nodes.size() > max_names) {
    text += " and " + std::to_string(peer.ros_nodes.size() - max_names) + " more nodes";
  }
  if (!text.empty()) return text;
  // rmw_fastrtps gives its participants the name of the enclave, which is "/" where there is none.
  return peer.name.empty() || peer.name == "/" ? "a participant without a name" : peer.name;
}

std::string describe(const RemoteParticipant& peer) {
  const std::string name = display_name(peer);
  const std::string where = describe_location(peer);
  return where.empty() ? name : name + " (" + where + ")";
}

std::string describe(const EndpointQos& qos) {
  std::string text = qos.reliable ? "reliable" : "best effort";
  add_part(text, name(qos.durability));
  for (const std::string& partition : qos.partitions) {
    add_part(text, "partition '" + partition + "'");
  }
  return text;
}

}  // namespace stillmap::dds
