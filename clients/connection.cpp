#include "clients/connection.hpp"

namespace stillmap {

Client::Connection::Connection(const ClientOptions& client_options)
    : options(client_options),
      topics(Topics::in(options.server_name)),
      names(Services::in(options.server_name)),
      participant(options.dds),
      get_static_map(participant, names.get_static_map),
      get_tile_versions(participant, names.get_tile_versions),
      get_tiles(participant, names.get_tiles),
      get_status(participant, names.get_status),
      save_map(participant, names.save_map),
      reset(participant, names.reset) {}

ServiceTimeout Client::Connection::no_answer(const std::string& name,
                                             std::chrono::milliseconds timeout, bool found) const {
  std::string text = "no answer from service " + name + " in DDS domain " +
                     std::to_string(options.dds.domain_id) + " within " +
                     std::to_string(timeout.count()) + " ms: ";
  if (found) return ServiceTimeout(text + "a server is there but too busy, or it was just killed");
  text += "no server found. Check that stillmap-server runs, in this domain, with topic name " +
          options.server_name + ", reachable over the same network interfaces";
  if (options.dds.shared_memory) {
    text += "; if it runs as another user or in a container, switch shared memory off";
  }
  return ServiceTimeout(text);
}

}  // namespace stillmap
