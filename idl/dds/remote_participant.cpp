#include "idl/dds/remote_participant.hpp"

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

std::string describe(const RemoteParticipant& peer) {
  const std::string name = peer.name.empty() ? "a participant without a name" : peer.name;
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
