#include "clients/library/client.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "clients/library/connection.hpp"
#include "clients/library/tcp_rejoin_backoff.hpp"
#include "idl/conversions/status.hpp"
#include "idl/conversions/tile.hpp"

namespace stillmap {

using namespace stillmap_msgs::srv;

namespace {

// A map that changes so fast that its pages are forgotten three times over is not worth waiting
// for.
constexpr int max_whole_map_attempts = 3;

Eigen::AlignedBox3d unbounded_box() {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  return {Eigen::Vector3d::Constant(-infinite), Eigen::Vector3d::Constant(infinite)};
}

void append_page(const MapQueryResult& page, MapQueryResult& whole) {
  whole.status = page.status;
  whole.reason = page.reason;
  whole.continuation = page.continuation;
  whole.voxels.insert(whole.voxels.end(), page.voxels.begin(), page.voxels.end());
}

}  // namespace

std::unique_ptr<Client::Connection> Client::connect(const ClientOptions& options) {
  auto connection = std::make_unique<Connection>(options);
  if (options.dds.transport != dds::NetworkTransport::tcp) return connection;
  // Before anything subscribes through the connection, another can take its place.
  const auto began = connection->connecting_since;
  GetStatus_Request request;
  request.format_version(dds::wire_format_version);
  TcpRejoinBackoff backoff(options.dds, options.request_timeout);
  while (connection->get_status.refusal().empty() &&
         !connection->get_status.call(request, backoff.next_wait()) && !backoff.timed_out()) {
    if (backoff.rejoin_due()) connection = std::make_unique<Connection>(options);
  }
  connection->connecting_since = began;
  return connection;
}

Client::Client(const ClientOptions& options) : connection_(connect(options)) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

void Client::wait_for_server(std::chrono::milliseconds timeout) {
  std::chrono::milliseconds waited{};
  if (connection_->options.dds.transport == dds::NetworkTransport::tcp) {
    // Of the timeout, something is left for the answer of a server that was found.
    const auto since = std::chrono::floor<std::chrono::milliseconds>(
        std::chrono::steady_clock::now() - connection_->connecting_since);
    waited = std::min(since, timeout / 2);
  }
  static_cast<void>(connection_->call(connection_->get_status, connection_->names.get_status,
                                      GetStatus_Request(), timeout - waited, waited));
}

dds::ServerStatus Client::status() {
  const auto reply = connection_->call_ok(connection_->get_status, connection_->names.get_status,
                                          GetStatus_Request());
  auto status = wire::from_wire(reply.server());
  if (!status) throw malformed_reply(connection_->names.get_status);
  return *std::move(status);
}

MapQueryResult Client::get_static_map(const MapQuery& query) {
  const auto reply =
      connection_->call(connection_->get_static_map, connection_->names.get_static_map,
                        wire::to_request(query), connection_->options.request_timeout);
  auto result = wire::from_response(reply);
  if (!result) throw malformed_reply(connection_->names.get_static_map);
  return *std::move(result);
}

MapQueryResult Client::get_whole_static_map(
    MapQuery query, const std::function<void(std::uint64_t, std::uint64_t)>& page_arrived) {
  for (int attempt = 1;; ++attempt) {
    query.continuation.clear();
    MapQueryResult whole = get_static_map(query);
    if (page_arrived) page_arrived(whole.voxels.size(), whole.total_voxels);
    while (whole.status == QueryStatus::ok && !whole.continuation.empty()) {
      query.continuation = whole.continuation;
      append_page(get_static_map(query), whole);
      if (page_arrived) page_arrived(whole.voxels.size(), whole.total_voxels);
    }
    if (whole.status != QueryStatus::stale_continuation || attempt == max_whole_map_attempts) {
      return whole;
    }
  }
}

TileVersions Client::get_tile_versions(const Eigen::AlignedBox3d& box_map) {
  GetTileVersions_Request request;
  request.min_x(box_map.min().x());
  request.min_y(box_map.min().y());
  request.max_x(box_map.max().x());
  request.max_y(box_map.max().y());
  const auto reply = connection_->call_ok(connection_->get_tile_versions,
                                          connection_->names.get_tile_versions, std::move(request));
  TileVersions versions{.map = wire::from_wire(reply.identity()), .tiles = {}};
  for (const auto& message : reply.tiles()) {
    const auto info = wire::from_wire(message);
    if (!info) throw malformed_reply(connection_->names.get_tile_versions);
    versions.tiles.push_back(*info);
  }
  return versions;
}

TileVersions Client::get_tile_versions() { return get_tile_versions(unbounded_box()); }

TileSet Client::get_tiles(std::span<const TileId> ids) { return connection_->fetch_tiles(ids); }

std::string Client::save_map(const std::string& file) {
  SaveMap_Request request;
  request.file(file);
  return connection_
      ->call_ok(connection_->save_map, connection_->names.save_map, std::move(request))
      .file();
}

LoadedMap Client::load_map(const std::string& file) {
  LoadMap_Request request;
  request.file(file);
  const auto reply =
      connection_->call_ok(connection_->load_map, connection_->names.load_map, std::move(request));
  return {.file = reply.file(),
          .map_id = reply.status().map_id(),
          .tile_count = reply.tile_count(),
          .pose_count = reply.pose_count()};
}

std::uint64_t Client::reset() {
  return connection_->call_ok(connection_->reset, connection_->names.reset, Reset_Request())
      .status()
      .map_id();
}

}  // namespace stillmap
