#include "clients/library/connection.hpp"

#include "idl/conversions/tile.hpp"
#include "idl/interface/participant_diagnostics.hpp"

namespace stillmap {

using namespace stillmap_msgs::srv;

namespace {

std::vector<stillmap_msgs::msg::TileId> to_wire(std::span<const TileId> ids) {
  std::vector<stillmap_msgs::msg::TileId> out(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    out[i].x(ids[i].x);
    out[i].y(ids[i].y);
  }
  return out;
}

void add_tiles(const GetTiles_Response& reply, TileSet& set) {
  for (const auto& message : reply.tiles()) {
    auto tile = wire::from_wire(message);
    if (!tile) throw malformed_reply("get_tiles");
    set.tiles.push_back(*std::move(tile));
  }
  for (const auto& id : reply.missing()) set.missing.push_back({id.x(), id.y()});
}

}  // namespace

ServiceError malformed_reply(const std::string& service) {
  return ServiceError("the answer of " + service +
                      " cannot be understood; client and server must have the same version");
}

Client::Connection::Connection(const ClientOptions& client_options)
    : options(client_options),
      topics(dds::Topics::in(options.server_name)),
      names(dds::Services::in(options.server_name)),
      participant(options.dds),
      get_static_map(participant, names.get_static_map),
      get_tile_versions(participant, names.get_tile_versions),
      get_tiles(participant, names.get_tiles),
      get_status(participant, names.get_status),
      save_map(participant, names.save_map),
      load_map(participant, names.load_map),
      reset(participant, names.reset),
      octomap_binary(participant, names.octomap_binary),
      octomap_full(participant, names.octomap_full),
      query_occupancy(participant, names.query_occupancy),
      get_traversable_area(participant, names.get_traversable_area),
      check_path(participant, names.check_path),
      nearest_traversable(participant, names.nearest_traversable),
      get_removed(participant, names.get_removed),
      restore_removed(participant, names.restore_removed),
      get_map(participant, names.get_map) {}

TileSet Client::Connection::fetch_tiles(std::span<const TileId> ids) {
  TileSet set;
  auto remaining = to_wire(ids);
  while (!remaining.empty()) {
    GetTiles_Request request;
    request.ids(remaining);
    const auto reply = call_ok(get_tiles, names.get_tiles, std::move(request));
    if (reply.left_out().size() >= remaining.size()) throw malformed_reply(names.get_tiles);
    set.map = wire::from_wire(reply.identity());
    add_tiles(reply, set);
    remaining = reply.left_out();
  }
  return set;
}

ServiceTimeout Client::Connection::timeout_error(const std::string& name,
                                                 std::chrono::milliseconds timeout,
                                                 bool found) const {
  std::string text = "no answer from service " + name + " in DDS domain " +
                     std::to_string(options.dds.domain_id) + " within " +
                     std::to_string(timeout.count()) + " ms: ";
  if (found) return ServiceTimeout(text + "a server is there but too busy, or it was just killed");
  // Where security keeps both apart, nothing else is to be looked for.
  const auto diagnostics =
      dds::security_diagnostics(participant.self(), participant.remote_participants());
  if (!diagnostics.empty()) {
    return ServiceTimeout(text + diagnostics.front().what + ": " + diagnostics.front().evidence +
                          "; " + diagnostics.front().hint);
  }
  text +=
      "no server found ('stillmap doctor' looks for the reason). Check that stillmap-server runs, "
      "in this domain, with topic name " +
      options.server_name + ", reachable over the same network interfaces";
  if (options.dds.shared_memory) {
    text += "; if it runs as another user or in a container, switch shared memory off";
  }
  return ServiceTimeout(text);
}

}  // namespace stillmap
