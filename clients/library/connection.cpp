#include "clients/library/connection.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include "idl/conversions/tile.hpp"
#include "idl/interface/participant_diagnostics.hpp"

namespace stillmap {

using namespace stillmap_msgs::srv;

namespace {

constexpr std::chrono::seconds noticeable_stop{1};

std::vector<stillmap_msgs::msg::TileId> to_wire(std::span<const TileId> ids) {
  std::vector<stillmap_msgs::msg::TileId> out(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    out[i].x(ids[i].x);
    out[i].y(ids[i].y);
  }
  return out;
}

}  // namespace

Client::Connection::Connection(const ClientOptions& client_options)
    : options(client_options),
      topics(dds::Topics::in(options.server_name)),
      participant(options.dds) {
  dds::for_each_service(
      [this]<typename Request, typename Reply>(const dds::ServiceSpec<Request, Reply>& spec) {
        clients.emplace(spec.name, std::make_shared<dds::ServiceClient<Request, Reply>>(
                                       participant, name_of(spec)));
      });
}

TileSet Client::Connection::fetch_tiles(std::span<const TileId> ids) {
  constexpr int max_attempts = 5;
  for (int attempt = 0; attempt < max_attempts; ++attempt) {
    TileSet set;
    const auto unread = add_tiles(ids, set);
    // Else another map began meanwhile: tiles of two maps are none.
    if (unread && add_unread(*unread, set)) return set;
  }
  throw ServiceError(name_of(dds::services::get_tiles) +
                     ": maps follow one another too fast; ask again");
}

std::optional<std::vector<TileId>> Client::Connection::add_tiles(std::span<const TileId> ids,
                                                                 TileSet& set) {
  constexpr const auto& service = dds::services::get_tiles;
  // More than an answer has, and few enough not to be sent again and again.
  constexpr std::size_t ids_per_request = 2000;
  std::set<TileId> unanswered(ids.begin(), ids.end());
  bool is_first = set.tiles.empty() && set.missing.empty();
  auto remaining = to_wire(ids.first(std::min(ids.size(), ids_per_request)));
  for (ids = ids.subspan(remaining.size()); !remaining.empty();) {
    GetTiles_Request request;
    request.ids(remaining);
    const auto next_request = [&] {
      remaining = to_wire(ids.first(std::min(ids.size(), ids_per_request)));
      ids = ids.subspan(remaining.size());
    };
    const auto reply = call_unrefused(service, std::move(request));
    if (wire::ReplyCode{reply.status().code()} == wire::ReplyCode::failed) {
      // None of these tiles can be read.
      set.fault = reply.status().reason();
      next_request();
      continue;
    }
    if (reply.remaining().size() >= remaining.size()) throw malformed_reply(name_of(service));
    const dds::MapIdentity map = wire::from_wire(reply.identity());
    if (!is_first && map.map_id != set.map.map_id) return std::nullopt;
    is_first = false;
    set.map = map;
    for (const auto& tile : reply.tiles()) {
      set.tiles.push_back(require_readable(wire::from_wire(tile), service));
      unanswered.erase(set.tiles.back().info.id);
    }
    for (const auto& id : reply.missing()) {
      set.missing.push_back({id.x(), id.y()});
      unanswered.erase(set.missing.back());
    }
    remaining = reply.remaining();
    if (remaining.empty()) next_request();
  }
  return std::vector<TileId>(unanswered.begin(), unanswered.end());
}

bool Client::Connection::add_unread(std::span<const TileId> ids, TileSet& set) {
  if (!ids.empty()) {
    auto unread = add_tiles(ids, set);
    if (!unread) return false;
    set.unreadable = *std::move(unread);
  }
  if (set.unreadable.empty()) {
    set.fault.clear();
  } else if (set.fault.empty()) {
    set.fault = "the server could not read them; its log says why";
  }
  return true;
}

TileVersions Client::Connection::list_tiles(const Eigen::AlignedBox3d& box_map) {
  GetTileVersions_Request request;
  request.min_x(box_map.min().x());
  request.min_y(box_map.min().y());
  request.max_x(box_map.max().x());
  request.max_y(box_map.max().y());
  TileVersions versions;
  for (bool has_more = true; has_more;) {
    const bool is_first = request.continuation().empty();
    const auto reply = call_ok(dds::services::get_tile_versions, GetTileVersions_Request(request));
    const dds::MapIdentity map = wire::from_wire(reply.identity());
    if (is_first) versions = {.map = map, .tiles = {}};
    if (map.map_id != versions.map.map_id) {
      // Another map than on the pages before: from the beginning.
      request.continuation().clear();
      continue;
    }
    for (const auto& message : reply.tiles()) {
      versions.tiles.push_back(
          require_readable(wire::from_wire(message), dds::services::get_tile_versions));
    }
    request.continuation(reply.continuation());
    has_more = !reply.continuation().empty();
  }
  return versions;
}

void Client::Connection::require_one_server(const std::string& service) {
  std::vector<dds::RemoteParticipant> servers =
      dds::servers_called(options.server_name, participant.remote_participants());
  if (servers.size() < 2) return;
  // One that was killed is known until its lease ends.
  constexpr std::chrono::milliseconds longest_answer(1000);
  GetStatus_Request question;
  question.format_version(dds::wire_format_version);
  const std::optional<std::vector<std::string>> alive =
      client_of(dds::services::get_status)
          .who_answers(question, std::min(longest_answer, options.request_timeout));
  if (!alive) {
    throw ServiceError(service + " was not sent: several servers may be called '" +
                       options.server_name +
                       "', and another thread waits for the status of one; ask again");
  }
  std::erase_if(servers, [&](const dds::RemoteParticipant& server) {
    return std::ranges::find(*alive, server.guid) == alive->end();
  });
  if (servers.size() < 2) return;
  std::string text = service + " was not sent, since it would reach " +
                     std::to_string(servers.size()) + " servers called '" + options.server_name +
                     "':";
  for (const dds::RemoteParticipant& server : servers)
    text += (&server == &servers.front() ? " " : "; ") + describe_location(server);
  throw ServiceError(text +
                     ". Reach one of them alone (--peer, --domain), stop all but one, or give each "
                     "its own topics.namespace (--server)");
}

ServiceError Client::Connection::malformed_reply(const std::string& service) {
  return ServiceError("the answer of " + service +
                      " cannot be understood; client and server must have the same version");
}

ServiceTimeout Client::Connection::timeout_error(const std::string& service,
                                                 std::chrono::milliseconds timeout,
                                                 const Unanswered& call) const {
  std::string text = "no answer from service " + service + " in DDS domain " +
                     std::to_string(options.dds.domain_id) + " within " +
                     std::to_string(timeout.count()) + " ms: ";
  if (call.overdue > noticeable_stop) {
    text += "this process itself was stopped or had no processor, for " +
            std::to_string(std::lround(call.overdue.count())) + " s; ask again; ";
  }
  if (call.found) {
    text += "a server is there but too busy, or it was just killed";
    return ServiceTimeout(call.modifies ? text + "; the request may still be carried out" : text);
  }
  // Where security keeps both apart, other reasons are irrelevant.
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
