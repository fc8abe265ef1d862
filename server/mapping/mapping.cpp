#include "server/mapping/mapping.hpp"

#include <utility>

namespace stillmap::server {
namespace {

LiveLoopConfig live_loops(const ServerConfig& config) {
  LiveLoopConfig loops;
  loops.min_shift_m = 0.5 * config.mapper.static_map.voxel_size_m;
  loops.gnss.max_sigma_m = config.gnss.max_sigma_m;
  loops.gnss.delay_s = config.gnss.time_offset_s;
  if (!config.gnss.antenna_base) loops.gnss.expect_antenna_anywhere();
  return loops;
}

/// Means and classes of the voxels that were first seen until a stamp, within this distance across
/// of a place. Tiles that cannot be read, or have just changed on disk, are left out.
std::vector<LabelledPoint> points_seen_until(const MapSnapshot& view, TileReader& tiles,
                                             std::int64_t stamp_ns,
                                             const Eigen::Vector2d& position_map, double radius_m) {
  std::vector<LabelledPoint> points;
  const Eigen::Vector3d centre_map(position_map.x(), position_map.y(), 0.0);
  const Eigen::Vector3d reach(radius_m, radius_m, VoxelGrid::max_coordinate_m);
  for (const auto& known : tiles_in_box(view, {centre_map - reach, centre_map + reach})) {
    try {
      for (const Voxel& voxel : tiles.read(known)->voxels) {
        if (voxel.first_seen_ns > stamp_ns) continue;
        const Eigen::Vector2d across = voxel.mean_map.head<2>().cast<double>() - position_map;
        if (across.squaredNorm() > radius_m * radius_m) continue;
        points.push_back({voxel.mean_map, voxel.evidence.winner()});
      }
    } catch (const std::runtime_error&) {
      continue;
    }
  }
  return points;
}

/// Null where there is none.
template <typename T>
T* pointer_to(std::optional<T>& part) {
  return part ? &*part : nullptr;
}

}  // namespace

Mapping::Mapping(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter,
                 OpenSegmenter open_segmenter, const MappingContext& context)
    : label_source_(segmenter->name()),
      storage_(context.storage),
      scans_(config.input.queue_length),
      poses_(context.participant, context.topics, config.frames),
      place_finder_(config, storage_.latest_map(), storage_.tiles(), context.statistics) {
  open_topics(config, context);
  open_loops(config, context);
  if (!config.automatic_sensor.is_on) context.statistics.set_sensor(config.mapper.sensor.name);
  thread_.emplace(config, std::move(segmenter), storage_.take_loaded(),
                  storage_.saver().tile_store(), scans_, context.statistics, storage_.latest_map(),
                  outputs(std::move(open_segmenter), context));
  storage_.saver().set_source(*thread_);
  checkpoints_.emplace(std::chrono::duration<double>(config.map.save_period_s),
                       [this] { storage_.saver().save_if_changed(); });
}

void Mapping::open_topics(const ServerConfig& config, const MappingContext& context) {
  if (config.publish.scan) labelled_scans_.emplace(context.participant, context.topics);
  if (!config.topics.odometry_prior.empty()) {
    prior_.emplace(context.participant, config.topics.odometry_prior, context.statistics);
  }
  if (!config.frames.base.empty()) {
    static_transforms_.emplace(context.participant, context.topics, context.statistics);
  }
  if (!config.topics.imu.empty())
    imu_.emplace(context.participant, config.topics.imu, config.input.delivery, context.statistics);
  if (!config.topics.initial_pose.empty()) {
    initial_pose_.emplace(context.participant, config.topics.initial_pose, config.frames.map,
                          place_finder_, context.statistics);
  }
}

void Mapping::open_loops(const ServerConfig& config, const MappingContext& context) {
  if (!config.map.close_loops) return;
  loops_.emplace(
      live_loops(config), config.input.delivery == DeliveryMode::every, context.statistics,
      [this](std::int64_t stamp_ns, const Eigen::Vector2d& position_map, double radius_m) {
        return points_seen_until(*storage_.latest_map().view(), storage_.tiles(), stamp_ns,
                                 position_map, radius_m);
      },
      config.gnss.antenna_base.value_or(Eigen::Vector3d::Zero()));
  submaps_.emplace(context.participant, context.topics);
  if (!config.topics.gnss.empty()) {
    gnss_.emplace(context.participant, config.topics.gnss, config.input.delivery, *loops_,
                  context.statistics);
    earth_.emplace(context.participant, context.topics, config.frames.map);
  }
}

MappingOutputs Mapping::outputs(OpenSegmenter open_segmenter, const MappingContext& context) {
  return {.poses = &poses_,
          .scans = pointer_to(labelled_scans_),
          .prior = pointer_to(prior_),
          .static_transforms = pointer_to(static_transforms_),
          .imu = pointer_to(imu_),
          .occupancy = context.occupancy,
          .place_finder = &place_finder_,
          .loops = pointer_to(loops_),
          .tiles = &storage_.tiles(),
          .earth = pointer_to(earth_),
          .submaps = pointer_to(submaps_),
          .throttle = &context.throttle,
          .open_segmenter = std::move(open_segmenter)};
}

void Mapping::stop() {
  checkpoints_.reset();
  thread_->stop();
  storage_.saver().save_at_end();
}

void Mapping::reset(std::uint64_t map_id, const std::shared_ptr<TileStore>& tile_store) {
  thread_->reset(map_id, tile_store);
}

std::function<void()> Mapping::prepare(const SavedMap& map,
                                       const std::shared_ptr<TileStore>& tile_store) {
  return thread_->prepare(map, tile_store);
}

}  // namespace stillmap::server
