#include "clients/doctor/system_snapshot.hpp"

#include <algorithm>

namespace stillmap {

const ServerSeen* answering_server(const Evidence& evidence) {
  const auto found = std::ranges::find_if(evidence.servers, [&](const ServerSeen& server) {
    return server.status && server.name_space == evidence.server_name;
  });
  return found == evidence.servers.end() ? nullptr : &*found;
}

std::string points_topic_of(const Evidence& evidence) {
  const ServerSeen* const server = answering_server(evidence);
  const bool tells = server != nullptr && !server->status->points_topic.empty();
  return "rt/" + (tells ? server->status->points_topic : evidence.points_topic);
}

}  // namespace stillmap
