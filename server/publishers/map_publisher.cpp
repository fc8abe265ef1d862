#include "server/publishers/map_publisher.hpp"

#include <algorithm>
#include <chrono>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/map/voxel_grid.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/conversions/to_cloud.hpp"

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;

/// Of those that static_cloud shows, which are read into memory: 25 MB, some 100 m about the robot.
constexpr std::ptrdiff_t max_tiles_on_disk = 100;
/// What could not be read is tried again after so long.
constexpr std::chrono::seconds retry_period{5};

}  // namespace

MapPublisher::MapPublisher(dds::Participant& participant, const dds::Topics& topics,
                           const ServerConfig& config, const LatestMap& latest_map,
                           TileReader& tiles)
    : latest_map_(latest_map),
      map_frame_(config.frames.map),
      path_poses_(config.publish.path_poses),
      half_window_m_(static_cast<float>(config.publish.cloud_window_m / 2.0)),
      reader_(tiles),
      tiles_(participant, topics, tiles, config.publish.tile_window_m),
      path_(participant, topics.path.dds_name, topics.path.writer),
      cloud_(participant, topics.static_cloud.dds_name, topics.static_cloud.writer),
      tile_worker_("tiles", std::chrono::duration<double>(config.publish.tiles_period_s),
                   [this](const std::stop_token&) { publish_tiles(); }),
      path_worker_("path", std::chrono::duration<double>(config.publish.path_period_s),
                   [this](const std::stop_token&) { publish_path(); }),
      cloud_worker_("map_cloud", std::chrono::duration<double>(config.publish.cloud_period_s),
                    [this](const std::stop_token&) { publish_cloud(); }) {}

bool MapPublisher::has_changed(PathState& published, bool with_view) const {
  const auto view = latest_map_.view();
  const PathState now{.map_id = view->map_id,
                      .poses = latest_map_.poses_added(),
                      .corrections = latest_map_.corrections(),
                      .version = with_view ? view->version : 0};
  const bool is_none = now.poses == 0 && view->tiles.empty();
  const bool was_none = published == PathState();
  if (now == published || (is_none && was_none)) return false;
  published = now;
  return true;
}

void MapPublisher::publish_tiles() {
  tiles_.publish(latest_map_.view(), latest_map_.newest_pose().T_map_lidar.translation().head<2>());
}

void MapPublisher::publish_path() {
  if (!has_changed(published_path_, false)) return;
  // Keep-last writers always have room.
  static_cast<void>(path_.write(wire::to_path(latest_map_.trajectory(path_poses_), map_frame_)));
}

void MapPublisher::publish_cloud() {
  const bool is_retry = retry_cloud_ && Clock::now() >= *retry_cloud_;
  if (!has_changed(published_cloud_, true) && !is_retry) return;
  retry_cloud_.reset();
  const StampedPose pose = latest_map_.newest_pose();
  const Eigen::Vector2f centre_map = pose.T_map_lidar.translation().head<2>().cast<float>();
  const Eigen::Vector2f half = Eigen::Vector2f::Constant(half_window_m_);
  const Eigen::AlignedBox2f window_map(centre_map - half, centre_map + half);
  MapSnapshot view = *latest_map_.view();
  if (!read_window(view, window_map)) retry_cloud_ = Clock::now() + retry_period;
  static_cast<void>(cloud_.write(wire::to_cloud(view, window_map, pose.stamp_ns, map_frame_)));
}

bool MapPublisher::read_window(MapSnapshot& view, const Eigen::AlignedBox2f& window_map) {
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  const Eigen::Vector2d low = window_map.min().cast<double>();
  const Eigen::Vector2d high = window_map.max().cast<double>();
  auto on_disk = tiles_in_box(view, {Eigen::Vector3d(low.x(), low.y(), -everywhere),
                                     Eigen::Vector3d(high.x(), high.y(), everywhere)});
  std::erase_if(on_disk, [](const auto& tile) { return !is_non_resident(*tile); });
  if (std::ssize(on_disk) > max_tiles_on_disk) {
    throttled_log_.warn("static_cloud", "publish.cloud_window_m has " +
                                            std::to_string(on_disk.size()) +
                                            " tiles that are on disk: static_cloud shows the " +
                                            std::to_string(max_tiles_on_disk) + " nearest of them");
    const Eigen::Vector2d middle_map = 0.5 * (low + high);
    std::ranges::nth_element(
        on_disk, on_disk.begin() + max_tiles_on_disk, {}, [&](const auto& tile) {
          const Eigen::Vector2d corner(tile->info.id.x, tile->info.id.y);
          return (view.tile_size_m * (corner.array() + 0.5).matrix() - middle_map).norm();
        });
    on_disk.resize(max_tiles_on_disk);
  }
  std::size_t unread = 0;
  for (const auto& tile : on_disk) {
    try {
      view.tiles.set(reader_.read(tile));
    } catch (const std::runtime_error&) {
      // Changed since, or not to be read now.
      ++unread;
    }
  }
  if (unread > 0) {
    throttled_log_.warn("static_cloud_unread",
                        std::to_string(unread) +
                            " tiles that are on disk could not be read for static_cloud; they are "
                            "tried again");
  }
  return unread == 0;
}

}  // namespace stillmap::server
