#include "clients/library/client.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <thread>
#include <utility>

#include "clients/library/connection.hpp"
#include "clients/library/region_subscription.hpp"
#include "clients/library/tcp_rejoin_backoff.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/conversions/occupancy.hpp"
#include "idl/conversions/occupancy_grid.hpp"
#include "idl/conversions/path_query.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/conversions/region.hpp"
#include "idl/conversions/removed_voxels.hpp"
#include "idl/conversions/status.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/conversions/traversability.hpp"
#include "sensor_msgs.h"
#include "submaps.h"

namespace stillmap {

using namespace stillmap_msgs::srv;
namespace services = dds::services;

namespace {

// Pages expire when the map changes too far under a query.
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

/// A reader and the thread that hands its samples to the callback.
template <typename T>
class ReceiverThread final : public Subscription::Receiver {
 public:
  ReceiverThread(dds::Participant& participant, const dds::TopicSpec<T>& topic,
                 std::function<void(const T&)> sample_arrived)
      : sample_arrived_(std::move(sample_arrived)),
        reader_(participant, topic.dds_name, topic.reader),
        thread_([this](const std::stop_token& stop) { receive(stop); }) {}

 private:
  void receive(const std::stop_token& stop) {
    T sample;
    while (!stop.stop_requested()) {
      if (reader_.take(sample, stop, std::chrono::seconds(1))) sample_arrived_(sample);
    }
  }

  std::function<void(const T&)> sample_arrived_;
  dds::Reader<T> reader_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

template <typename T>
Subscription subscribe(dds::Participant& participant, const dds::TopicSpec<T>& topic,
                       std::function<void(const T&)> sample_arrived) {
  return Subscription(
      std::make_unique<ReceiverThread<T>>(participant, topic, std::move(sample_arrived)));
}

}  // namespace

std::unique_ptr<Client::Connection> Client::connect(const ClientOptions& options) {
  auto connection = std::make_unique<Connection>(options);
  if (options.dds.transport != dds::NetworkTransport::tcp) return connection;
  // Until something subscribes through the connection, it can be replaced.
  const auto began = connection->connecting_since;
  GetStatus_Request request;
  request.format_version(dds::wire_format_version);
  TcpRejoinBackoff backoff(options.dds, options.request_timeout);
  while (connection->client_of(services::get_status).refusal().empty() &&
         !connection->client_of(services::get_status).call(request, backoff.next_wait()) &&
         !backoff.timed_out()) {
    if (backoff.rejoin_due()) connection = std::make_unique<Connection>(options);
  }
  connection->connecting_since = began;
  return connection;
}

Client::Client(const ClientOptions& options) : connection_(connect(options)) {}
Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

void Client::wait_for_server(std::chrono::milliseconds timeout, std::chrono::milliseconds waited) {
  std::chrono::milliseconds connecting{};
  if (connection_->options.dds.transport == dds::NetworkTransport::tcp) {
    // Of the timeout, something is left for the answer of a server that was found.
    const auto since = std::chrono::floor<std::chrono::milliseconds>(
        std::chrono::steady_clock::now() - connection_->connecting_since);
    connecting = std::min(since, timeout / 2);
  }
  static_cast<void>(connection_->call(services::get_status, GetStatus_Request(),
                                      timeout - connecting, waited + connecting));
}

dds::ServerStatus Client::status() {
  const auto reply = connection_->call_ok(services::get_status, GetStatus_Request());
  return connection_->require_readable(wire::from_wire(reply.server()), services::get_status);
}

MapQueryResult Client::get_static_map(const MapQuery& query) {
  auto reply = connection_->call(services::get_static_map, wire::to_request(query));
  auto result = wire::from_response(reply);
  // More would be of another kind of server than ours.
  constexpr std::size_t max_kept_voxels = 400'000;
  if (reply.voxels().x().size() <= max_kept_voxels)
    connection_->client_of(services::get_static_map).reuse(std::move(reply));
  return connection_->require_readable(std::move(result), services::get_static_map);
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
  return connection_->list_tiles(box_map);
}

TileVersions Client::get_tile_versions() { return get_tile_versions(unbounded_box()); }

TileSet Client::get_tiles(std::span<const TileId> ids) { return connection_->fetch_tiles(ids); }

MapSnapshot Client::get_map() {
  for (int attempt = 1;; ++attempt) {
    const TileVersions versions = get_tile_versions();
    std::vector<TileId> ids;
    for (const TileInfo& info : versions.tiles) ids.push_back(info.id);
    TileSet set = get_tiles(ids);
    if (!set.unreadable.empty()) {
      const TileId id = set.unreadable.front();
      throw ServiceError(std::to_string(set.unreadable.size()) +
                         " tiles of the map cannot be read by the server, the first is (" +
                         std::to_string(id.x) + ", " + std::to_string(id.y) + "): " + set.fault);
    }
    const bool is_of_another_map = !ids.empty() && set.map.map_id != versions.map.map_id;
    if (is_of_another_map && attempt < max_whole_map_attempts) continue;
    if (is_of_another_map) throw ServiceError("maps follow one another too fast; ask again");
    MapSnapshot view{.version = ids.empty() ? versions.map.version : set.map.version,
                     .map_id = versions.map.map_id,
                     .tile_size_m = versions.map.tile_size_m,
                     .voxel_size_m = versions.map.voxel_size_m,
                     .tiles = {}};
    std::vector<std::shared_ptr<const Tile>> tiles;
    tiles.reserve(set.tiles.size());
    for (Tile& tile : set.tiles) tiles.push_back(std::make_shared<const Tile>(std::move(tile)));
    view.tiles = TileTable(std::move(tiles));
    return view;
  }
}

OctomapData Client::octomap(OctomapEncoding encoding) {
  const auto& service =
      encoding == OctomapEncoding::full ? services::octomap_full : services::octomap_binary;
  const auto reply = connection_->call(service, octomap_msgs::srv::GetOctomap_Request());
  // The standard's reply has no place for a reason.
  if (reply.map().id().empty()) {
    throw ServiceError(connection_->name_of(service) +
                       " has no octree: that of a map that has just begun is still being made (ask "
                       "again), or the server's configuration has occupancy.enabled false");
  }
  auto data = wire::from_octomap(reply.map());
  const bool is_sound = data && data->encoding == encoding && check_octomap(*data).fault.empty();
  if (!is_sound) data.reset();
  return connection_->require_readable(std::move(data), service);
}

OccupancyAnswers Client::query_occupancy(const OccupancyQuery& query) {
  const auto reply = connection_->call_ok(services::query_occupancy, wire::to_request(query));
  auto answers = wire::from_response(reply);
  const bool answers_all = answers && answers->points.size() == query.points_map.size() &&
                           answers->boxes.size() == query.boxes_map.size() &&
                           answers->rays.size() == query.rays.size();
  if (!answers_all) answers.reset();
  return connection_->require_readable(std::move(answers), services::query_occupancy);
}

TraversabilityAnswer Client::get_traversable_area(const TraversabilityQuery& query) {
  constexpr const auto& service = services::get_traversable_area;
  const auto reply = connection_->call_unfailing(service, wire::to_request(query));
  return connection_->require_readable(wire::from_response(reply), service);
}

PathCheck Client::check_path(const PathQuery& query) {
  constexpr const auto& service = services::check_path;
  const auto reply = connection_->call_unfailing(service, wire::to_request(query));
  return connection_->require_readable(wire::from_response(reply), service);
}

NearestTraversable Client::nearest_traversable(const std::string& profile,
                                               const Eigen::Vector2d& position_map,
                                               double max_distance_m) {
  constexpr const auto& service = services::nearest_traversable;
  NearestTraversable_Request request;
  request.profile(profile);
  request.x(position_map.x());
  request.y(position_map.y());
  request.max_distance_m(max_distance_m);
  const auto reply = connection_->call_unfailing(service, std::move(request));
  return connection_->require_readable(wire::from_response(reply), service);
}

OccupancyGrid Client::planning_grid() {
  const auto reply = connection_->call(services::get_map, nav_msgs::srv::GetMap_Request());
  return connection_->require_readable(wire::from_message(reply.map()), services::get_map);
}

RemovedVoxels Client::get_removed(const Region& region, std::uint32_t max_voxels) {
  GetRemoved_Request request;
  request.region(wire::to_wire(region));
  request.max_voxels(max_voxels);
  const auto reply = connection_->call_ok(services::get_removed, std::move(request));
  return {connection_->require_readable(wire::from_response(reply), services::get_removed),
          reply.total(), reply.status().reason()};
}

std::uint64_t Client::restore_removed(RemovalReason reason, const BoxRegion& box) {
  RestoreRemoved_Request request;
  request.region(wire::to_wire(Region(box)));
  request.reason(static_cast<std::uint8_t>(reason));
  return connection_->call_ok(services::restore_removed, std::move(request)).restored();
}

LocalizationAnswer Client::localize(const LocalizationQuestion& question) {
  const auto reply = connection_->call_ok(services::localize, wire::to_request(question));
  return connection_->require_readable(wire::from_response(reply), services::localize);
}

std::string Client::save_map(const std::string& file, bool overwrite) {
  SaveMap_Request request;
  request.file(file);
  request.overwrite(overwrite);
  return connection_->call_ok(services::save_map, std::move(request)).file();
}

LoadedMap Client::load_map(const std::string& file) {
  LoadMap_Request request;
  request.file(file);
  const auto reply = connection_->call_ok(services::load_map, std::move(request));
  return {.file = reply.file(),
          .map_id = reply.status().map_id(),
          .tile_count = reply.tile_count(),
          .pose_count = reply.pose_count()};
}

BegunMap Client::reset(bool discard) {
  Reset_Request request;
  request.discard(discard);
  const auto reply = connection_->call_ok(services::reset, std::move(request));
  return {.map_id = reply.status().map_id(), .kept_file = reply.kept_file()};
}

Subscription Client::subscribe_points(const std::string& ros_topic, DeliveryMode delivery,
                                      const wire::CloudReadOptions& reading,
                                      std::function<void(const Scan&)> scan_arrived) {
  constexpr int queue_length = 10;
  return subscribe<sensor_msgs::msg::PointCloud2>(
      connection_->participant, dds::points_topic(ros_topic, delivery, queue_length),
      [reader = wire::CloudReader(reading),
       arrived = std::move(scan_arrived)](const sensor_msgs::msg::PointCloud2& message) mutable {
        const auto read = reader.read(message);
        if (read.from_cloud.scan) arrived(*read.from_cloud.scan);
      });
}

Subscription Client::subscribe_labelled_scans(std::function<void(const Scan&)> scan_arrived) {
  dds::TopicSpec<sensor_msgs::msg::PointCloud2> topic = connection_->topics.scan;
  topic.reader.depth = 10;
  return subscribe<sensor_msgs::msg::PointCloud2>(
      connection_->participant, topic,
      [arrived = std::move(scan_arrived)](const sensor_msgs::msg::PointCloud2& message) {
        const auto read = wire::to_scan(message, {.fields = {}, .labels_are_classes = true});
        if (read.scan) arrived(*read.scan);
      });
}

Subscription Client::subscribe_odometry(std::function<void(const OdometryUpdate&)> pose_arrived) {
  return subscribe<nav_msgs::msg::Odometry>(
      connection_->participant, connection_->topics.odometry,
      [arrived = std::move(pose_arrived)](const nav_msgs::msg::Odometry& message) {
        const auto odometry = wire::from_odometry(message);
        if (!odometry) return;
        arrived({.pose = odometry->pose,
                 .frame = message.header().frame_id(),
                 .child_frame = message.child_frame_id(),
                 .covariance = odometry->covariance});
      });
}

Subscription Client::subscribe_status(
    std::function<void(const dds::ServerStatus&)> status_arrived) {
  return subscribe<stillmap_msgs::msg::Status>(
      connection_->participant, connection_->topics.status,
      [arrived = std::move(status_arrived)](const stillmap_msgs::msg::Status& message) {
        const auto status = wire::from_wire(message);
        if (status) arrived(*status);
      });
}

Subscription Client::subscribe_octomap(std::function<void(const OctomapData&)> octomap_arrived) {
  return subscribe<octomap_msgs::msg::Octomap>(
      connection_->participant, connection_->topics.octomap,
      [arrived = std::move(octomap_arrived)](const octomap_msgs::msg::Octomap& message) {
        const auto data = wire::from_octomap(message);
        if (data && check_octomap(*data).fault.empty()) arrived(*data);
      });
}

Subscription Client::subscribe_path(std::function<void(const Trajectory&)> path_arrived) {
  return subscribe<nav_msgs::msg::Path>(
      connection_->participant, connection_->topics.path,
      [arrived = std::move(path_arrived)](const nav_msgs::msg::Path& message) {
        arrived(wire::from_path(message));
      });
}

Subscription Client::subscribe_submaps(std::function<void(const SubmapsOfMap&)> submaps_arrived) {
  return subscribe<stillmap_msgs::msg::SubmapList>(
      connection_->participant, connection_->topics.submaps,
      [arrived = std::move(submaps_arrived)](const stillmap_msgs::msg::SubmapList& message) {
        const auto submaps = wire::from_wire(message);
        if (submaps) arrived(*submaps);
      });
}

Subscription Client::subscribe_planning_grid(
    std::function<void(const OccupancyGrid&)> grid_arrived) {
  return subscribe<nav_msgs::msg::OccupancyGrid>(
      connection_->participant, connection_->topics.traversability,
      [arrived = std::move(grid_arrived)](const nav_msgs::msg::OccupancyGrid& message) {
        const auto grid = wire::from_message(message);
        if (grid) arrived(*grid);
      });
}

Subscription Client::subscribe_tiles(
    std::function<void(const dds::MapIdentity&, const Tile&)> tile_arrived) {
  return subscribe<stillmap_msgs::msg::MapTile>(
      connection_->participant, connection_->topics.tiles,
      [arrived = std::move(tile_arrived)](const stillmap_msgs::msg::MapTile& message) {
        const auto tile = wire::from_wire(message);
        if (tile) arrived(wire::from_wire(message.identity()), *tile);
      });
}

Subscription Client::subscribe_tile_index(
    std::function<void(const dds::MapIdentity&, const TileInfo&)> info_arrived) {
  return subscribe<stillmap_msgs::msg::TileInfo>(
      connection_->participant, connection_->topics.tile_index,
      [arrived = std::move(info_arrived)](const stillmap_msgs::msg::TileInfo& message) {
        const auto info = wire::from_wire(message);
        if (info) arrived(wire::from_wire(message.identity()), *info);
      });
}

Subscription Client::subscribe_region(const Region& region,
                                      std::function<void(const RegionUpdate&)> update_arrived) {
  const RegionShape shape(region);
  Connection& connection = *connection_;
  return make_region_subscription(
      connection.participant, connection.topics, region,
      [&connection, box_map = shape.bounds_map()] { return connection.list_tiles(box_map); },
      [&connection](std::span<const TileId> ids) { return connection.fetch_tiles(ids); },
      std::move(update_arrived));
}

}  // namespace stillmap
