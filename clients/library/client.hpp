#pragma once

#include <Eigen/Geometry>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/map/query/map_query.hpp"
#include "core/map/tile.hpp"
#include "core/occupancy/occupancy_query.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_query.hpp"
#include "core/traversability/traversability_view.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/conversions/localization.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/conversions/submaps.hpp"
#include "idl/dds/dds_options.hpp"
#include "idl/interface/map_identity.hpp"
#include "idl/interface/server_status.hpp"

namespace stillmap {

/// No answer, no server, or a server that refuses. The text names the service, the domain and what
/// to check.
class ServiceError : public std::runtime_error {
 public:
  explicit ServiceError(const std::string& text, std::optional<wire::ReplyCode> code = std::nullopt)
      : std::runtime_error(text), code_(code) {}

  /// Of the server's reply; nothing where none came, or what came cannot be understood.
  [[nodiscard]] std::optional<wire::ReplyCode> code() const { return code_; }

 private:
  std::optional<wire::ReplyCode> code_;
};

/// There was no answer in time.
class ServiceTimeout : public ServiceError {
 public:
  using ServiceError::ServiceError;
};

/// As the profile `lan` has it for clients: config/dds/lan.yaml says why.
[[nodiscard]] inline dds::DdsOptions without_shared_memory(dds::DdsOptions options = {}) {
  options.shared_memory = false;
  return options;
}

struct ClientOptions {
  dds::DdsOptions dds = without_shared_memory();
  /// First part of the server's topic and service names.
  std::string server_name = "stillmap";
  /// Longest wait for an answer, discovery and retries included.
  std::chrono::milliseconds request_timeout{5000};
};

/// A pose as the server estimated it: of the robot, or of its lidar where the server knows no other
/// frame (frames.base). How healthy the odometry is, is in ServerStatus::health.
struct OdometryUpdate {
  StampedPose pose;
  /// As "map" and "base_link".
  std::string frame;
  std::string child_frame;
  /// Of (translation [m], rotation [rad]) in the map frame.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
};

/// The tiles of a map, without their voxels.
struct TileVersions {
  dds::MapIdentity map;
  std::vector<TileInfo> tiles;
};

struct TileSet {
  /// All tiles are of this map.
  dds::MapIdentity map;
  std::vector<Tile> tiles;
  /// Tiles asked for that the map does not have.
  std::vector<TileId> missing;
  /// Those that the server could not read, also when asked again: its file is damaged there, say.
  std::vector<TileId> unreadable;
  /// Why; empty where none is.
  std::string fault;
};

/// A map file that a server resumed.
struct LoadedMap {
  /// On the server's machine.
  std::string file;
  /// The map's new id.
  std::uint64_t map_id = 0;
  std::uint64_t tile_count = 0;
  std::uint64_t pose_count = 0;
};

/// The map that a reset began.
struct BegunMap {
  std::uint64_t map_id = 0;
  /// Where the map until then is kept, on the server's machine; empty where it is not.
  std::string kept_file;
};

struct RemovedVoxels {
  std::vector<RemovedVoxel> voxels;
  /// Of the region, also those that did not come.
  std::uint64_t total = 0;
  /// Why there may be more: tiles that the server cannot read. Empty where there are none.
  std::string incomplete = {};
};

/// What changed in a region since the last update. Tiles are whole, including parts outside of the
/// region.
struct RegionUpdate {
  dds::MapIdentity map;
  std::vector<Tile> appeared;
  std::vector<Tile> changed;
  std::vector<TileId> removed;
};

/// Keeps a subscription alive. Ends it when destroyed, after a running callback returned; must not
/// be destroyed from inside its own callback.
class Subscription {
 public:
  /// What a subscription holds: a reader and the thread that waits on it.
  class Receiver {
   public:
    virtual ~Receiver() = default;
  };

  Subscription() = default;
  explicit Subscription(std::unique_ptr<Receiver> receiver) : receiver_(std::move(receiver)) {}

  /// Ends it early.
  void end() { receiver_.reset(); }

 private:
  std::unique_ptr<Receiver> receiver_;
};

/// A client of one stillmap-server. Requests may come from any thread and block until the answer is
/// there; they throw ServiceTimeout without an answer within `request_timeout` and ServiceError
/// when the server refuses.
class Client {
 public:
  /// Joins the domain; over TCP it also waits for the server, up to `request_timeout`, and joins
  /// anew after 4, 12, 28 s without one, but never later. Throws DdsError when the domain or an
  /// interface cannot be used.
  explicit Client(const ClientOptions& options = {});
  ~Client();
  Client(Client&&) noexcept;
  Client& operator=(Client&&) noexcept;

  /// Returns when a server answers; throws ServiceTimeout after `timeout`, of which over TCP up to
  /// half may have passed since the client was made. Its text counts what was `waited` before, too.
  void wait_for_server(std::chrono::milliseconds timeout, std::chrono::milliseconds waited = {});

  [[nodiscard]] dds::ServerStatus status();

  /// One page of a region of the static map. Hand `continuation` back in the query for the next
  /// page. A refused query is a result with its status and reason, not an exception.
  [[nodiscard]] MapQueryResult get_static_map(const MapQuery& query);

  /// All pages of the answer, all of one map version: `tiles` and `voxels` of all of them. Starts
  /// over when the map changed too far under it. `page_arrived(voxels so far, total)` may be empty.
  [[nodiscard]] MapQueryResult get_whole_static_map(
      MapQuery query, const std::function<void(std::uint64_t, std::uint64_t)>& page_arrived = {});

  /// Revision and hash of every tile whose footprint meets the box (map frame [m]); infinite faces
  /// are allowed.
  [[nodiscard]] TileVersions get_tile_versions(const Eigen::AlignedBox3d& box_map);
  /// Of the whole map.
  [[nodiscard]] TileVersions get_tile_versions();

  /// These tiles with their voxels. Asks as often as the server's answer size needs, and from the
  /// beginning where another map begins meanwhile. Voxels come without the runner-up classes'
  /// evidence.
  [[nodiscard]] TileSet get_tiles(std::span<const TileId> ids);
  /// All tiles of the map, as they are now. Throws ServiceError where one cannot be read.
  [[nodiscard]] MapSnapshot get_map();

  /// The server's octree of occupied, free and unknown space, checked.
  [[nodiscard]] OctomapData octomap(OctomapEncoding encoding);
  /// Points, boxes and rays at once. Each answer has its own fault; throws ServiceError when the
  /// query as a whole is refused.
  [[nodiscard]] OccupancyAnswers query_occupancy(const OccupancyQuery& query);
  /// Where a robot can go in a region. A refused query is a result with its status and reason.
  [[nodiscard]] TraversabilityAnswer get_traversable_area(const TraversabilityQuery& query);
  /// Whether a robot can follow a path, or the first place where it cannot. The same.
  [[nodiscard]] PathCheck check_path(const PathQuery& query);
  /// The free cell nearest to a place (map frame [m]). The same.
  [[nodiscard]] NearestTraversable nearest_traversable(const std::string& profile,
                                                       const Eigen::Vector2d& position_map,
                                                       double max_distance_m = 100.0);
  /// The grid of the server's planning robot, as Nav2 gets it; of no size when there is none.
  [[nodiscard]] OccupancyGrid planning_grid();

  /// What the server keeps out of its static map in a region, and why: all of it, up to
  /// `max_voxels` (the server sends at most 300,000).
  [[nodiscard]] RemovedVoxels get_removed(const Region& region, std::uint32_t max_voxels = 300'000);
  /// Has the server show again what was removed for this reason in a box; returns how many voxels.
  std::uint64_t restore_removed(RemovalReason reason, const BoxRegion& box);

  /// Where the server's last scan is in its map; a place that was not found is an answer, too. With
  /// `apply` the server goes on there once the scans that follow confirm it; otherwise nothing
  /// changes. Throws std::invalid_argument for a guess whose radius or turn is not above 0.
  [[nodiscard]] LocalizationAnswer localize(const LocalizationQuestion& question = {});

  /// Has the server save its map; returns the file's name on the server's machine. An empty name
  /// means the file that it saves to anyhow. Another map of that name is refused, unless
  /// `overwrite`.
  std::string save_map(const std::string& file = {}, bool overwrite = false);

  /// Has the server save its map, resume one that was saved before, and save to that file from then
  /// on. `file` is a plain name beside the configured map file. A map that is missing, damaged,
  /// newer or of another voxel size is refused, and the running map continues. An empty name means
  /// back to the last save of the running map.
  LoadedMap load_map(const std::string& file = {});

  /// Has the server start an empty map and trajectory. The map until then is kept in a file beside
  /// the server's map file, unless `discard`; without a map file, one that was never saved by name
  /// is refused (ServiceError).
  BegunMap reset(bool discard = false);

  /// Calls back for every pose. Each subscription has its own thread, and its calls never overlap;
  /// it ends with the Subscription, which must not outlive the client.
  [[nodiscard]] Subscription subscribe_odometry(
      std::function<void(const OdometryUpdate&)> pose_arrived);
  /// Once a second, and when the health changes.
  [[nodiscard]] Subscription subscribe_status(
      std::function<void(const dds::ServerStatus&)> status_arrived);
  /// The whole path since the map began, at most once a second.
  [[nodiscard]] Subscription subscribe_path(std::function<void(const Trajectory&)> path_arrived);
  /// Where the submaps of the map lie: at once as they are now, and whenever there is another one
  /// or loop closing has moved them. Nothing comes from a server that closes no loops.
  [[nodiscard]] Subscription subscribe_submaps(
      std::function<void(const SubmapsOfMap&)> submaps_arrived);
  /// The newest version of every tile, first those that exist already.
  [[nodiscard]] Subscription subscribe_tiles(
      std::function<void(const dds::MapIdentity&, const Tile&)> tile_arrived);
  /// As subscribe_tiles, without the voxels; a tile without any is gone.
  [[nodiscard]] Subscription subscribe_tile_index(
      std::function<void(const dds::MapIdentity&, const TileInfo&)> info_arrived);

  /// The octree (binary) when it changed, as often as the server publishes it.
  [[nodiscard]] Subscription subscribe_octomap(
      std::function<void(const OctomapData&)> octomap_arrived);
  /// The grid of the server's planning robot, whenever it changes.
  [[nodiscard]] Subscription subscribe_planning_grid(
      std::function<void(const OccupancyGrid&)> grid_arrived);

  /// The tiles whose footprint meets the region: first those that exist, then what changes. Tiles
  /// outside of it do not come over the network, only their entries in the index (some 100
  /// bytes), which this process ignores. When another map begins, the tiles of the last one are
  /// removed, some two seconds later where it has none here; its tiles may have another edge.
  /// Throws std::invalid_argument for a region with faults, and as a request does.
  [[nodiscard]] Subscription subscribe_region(
      const Region& region, std::function<void(const RegionUpdate&)> update_arrived);

  /// Scans of the sensor's topic (ROS 2 name), as the server gets them; those that cannot be read
  /// are passed over. `delivery` is the server's: with `every`, a lossless sender waits for this
  /// subscription, too.
  [[nodiscard]] Subscription subscribe_points(const std::string& ros_topic, DeliveryMode delivery,
                                              const wire::CloudReadOptions& reading,
                                              std::function<void(const Scan&)> scan_arrived);
  /// Prepared scans with the classes that the server gave them: the usable points only,
  /// motion-compensated, in the order of the sensor's scan of the same stamp. Best effort.
  [[nodiscard]] Subscription subscribe_labelled_scans(
      std::function<void(const Scan&)> scan_arrived);

 private:
  friend class ScanPublisher;
  struct Connection;
  [[nodiscard]] static std::unique_ptr<Connection> connect(const ClientOptions& options);

  std::unique_ptr<Connection> connection_;
};

}  // namespace stillmap
