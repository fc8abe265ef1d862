#include "clients/doctor/system_snapshot.hpp"

#include <algorithm>

namespace stillmap::cli {

const DiscoveredServer* answering_server(const SystemSnapshot& snapshot) {
  const auto found = std::ranges::find_if(snapshot.servers, [&](const DiscoveredServer& server) {
    return server.status && server.name_space == snapshot.server_name;
  });
  return found == snapshot.servers.end() ? nullptr : &*found;
}

std::string points_topic_of(const SystemSnapshot& snapshot) {
  const DiscoveredServer* const server = answering_server(snapshot);
  const bool tells = server != nullptr && !server->status->points_topic.empty();
  return "rt/" + (tells ? server->status->points_topic : snapshot.points_topic);
}

}  // namespace stillmap::cli
