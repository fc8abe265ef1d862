#include "server/mapping/mapping_thread.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "core/frames/rigid_motion.hpp"
#include "core/map/map_id.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/segmentation/lidar_tilt.hpp"
#include "server/mapping/milliseconds.hpp"

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;

// How long a request, or the snapshot after the last scan, may wait while no scan comes.
constexpr std::chrono::milliseconds idle_period{50};

// Fewer than make a mapper believe a clock (ScanClock), more than a new sender repeats.
constexpr int steps_of_set_clock = 5;

constexpr std::size_t no_limit = std::numeric_limits<std::size_t>::max();

// The rest of the limit is for copies: in the writers' histories, and for queries.
std::size_t map_share_bytes(const MapFileConfig& config) {
  if (config.memory_limit_mib == 0) return no_limit;
  return (std::size_t{config.memory_limit_mib} << 20) / 4 * 3;
}

}  // namespace

MappingThread::MappingThread(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter,
                             const std::optional<SavedMap>& stored,
                             const std::shared_ptr<TileStore>& tile_store, ScanQueue& queue,
                             Statistics& statistics, LatestMap& latest_map,
                             const MappingOutputs& outputs)
    : map_limit_bytes_(map_share_bytes(config.map)),
      mapper_config_(config.mapper),
      factory_(
          config,
          outputs.place_finder != nullptr ? mapper_config_beside_finder(config) : config.mapper,
          outputs.open_segmenter, queue, statistics),
      is_live_(config.input.delivery == DeliveryMode::latest),
      named_sensor_(config.automatic_sensor.is_on
                        ? nullptr
                        : std::make_shared<const SensorModel>(config.mapper.sensor)),
      sensor_period_s_(config.mapper.sensor.period_s),
      publish_period_(config.publish.tiles_period_s),
      queue_(queue),
      statistics_(statistics),
      latest_map_(latest_map),
      outputs_(outputs),
      mapper_(factory_.make(std::move(segmenter), listeners())),
      corrector_(mapper_, map_limit_bytes_),
      imu_report_(statistics),
      frames_(config, outputs.static_transforms, statistics),
      prior_(outputs.prior, frames_, config.frames.odom, config.mapper.sensor.motion_limits,
             statistics),
      map_frame_(config.frames.map),
      odom_frame_(config.frames.odom) {
  const bool is_odom_own = config.frames.odom_source == FramesConfig::OdomSource::own;
  if (!odom_frame_.empty() && is_odom_own) odom_.emplace();
  if (stored && !stored->view.tiles.empty()) {
    PreparedMap prepared(resumed(*stored, tile_store), stored->trajectory, tile_store);
    exchange(prepared);
  } else {
    tile_store_ = tile_store;
    mapper_.static_map().use_tile_store(tile_store);
    mapper_.reset(new_map_id());
    begin_map({}, std::nullopt);
  }
  worker_.emplace(
      "mapping", queue_,
      [this](QueuedScan queued) {
        // Before the requests: its pose is urgent.
        map(std::move(queued));
        end_round(false);
      },
      WorkerOptions{.on_idle = [this] { end_round(true); },
                    .idle_period = idle_period,
                    // Then only checkpoints are wanted.
                    .on_failure = [this] { requests_.close([this] { end_correction(); }); }});
}

MapperListeners MappingThread::listeners() {
  return {.stage_ended = [this](std::string_view stage) { stage_ended(stage); },
          .pose_found = [this](std::int64_t stamp_ns,
                               const OdometryResult& odometry) { pose_found(stamp_ns, odometry); },
          .scan_prepared =
              [this](const Scan& scan, const PointLabels& labels) {
                outputs_.place_finder->add(scan, labels, frames_.T_base_lidar(), mapper_);
              }};
}

bool MappingThread::tells_lidar(const std::shared_ptr<const SensorModel>& sensor) const {
  return sensor && sensor != sensor_ && factory_.knows_other_lidars();
}

bool MappingThread::leans_by_published_mount() const {
  return !frames_.is_configured() && !LidarTilt(frames_.T_base_lidar().linear()).is_upright();
}

std::shared_ptr<const SensorModel> MappingThread::sensor_of(const QueuedScan& queued) const {
  return queued.sensor || !leans_by_published_mount() ? queued.sensor : named_sensor_;
}

bool MappingThread::use_sensor(const std::shared_ptr<const SensorModel>& sensor) {
  if (!tells_lidar(sensor)) return false;
  const bool is_configured =
      !sensor_ && sensor->name == mapper_config_.sensor.name && !leans_by_published_mount();
  sensor_ = sensor;
  statistics_.set_sensor(sensor->name);
  factory_.tell_of_better_model(*sensor);
  if (is_configured) return false;
  factory_.use_sensor(*sensor, frames_.T_base_lidar(), mapper_);
  sensor_period_s_ = sensor->period_s;
  if (outputs_.place_finder != nullptr) outputs_.place_finder->use_sensor(*sensor);
  return true;
}

void MappingThread::reset(std::uint64_t map_id, const std::shared_ptr<TileStore>& tile_store) {
  StaticMap map(mapper_config_.static_map);
  map.reset(map_id);
  map.use_tile_store(tile_store);
  PreparedMap prepared(ResumedMap::of(std::move(map)), {}, tile_store);
  requests_.run([&] { exchange(prepared); });
  spdlog::info("reset: map {} begins", map_id);
}

std::function<void()> MappingThread::prepare(const SavedMap& stored,
                                             const std::shared_ptr<TileStore>& tile_store) {
  auto prepared =
      std::make_shared<PreparedMap>(resumed(stored, tile_store), stored.trajectory, tile_store);
  return [this, prepared = std::move(prepared)] {
    requests_.run([&] { exchange(*prepared); });
    const auto view = latest_map_.view();
    spdlog::info("loaded: resuming with {} tiles as map {}", view->tiles.size(), view->map_id);
  };
}

ResumedMap MappingThread::resumed(const SavedMap& stored,
                                  const std::shared_ptr<TileStore>& tile_store) const {
  StaticMap map(mapper_config_.static_map);
  map.resume(stored.view, stored.tile_evidence);
  map.begin_session();
  map.use_tile_store(tile_store);
  const SharedTrajectory& path = stored.trajectory;
  const Eigen::Vector3d last_map =
      path.empty() ? Eigen::Vector3d(0.0, 0.0, 0.0) : path.back().T_map_lidar.translation();
  return ResumedMap::of(std::move(map), last_map, mapper_config_);
}

void MappingThread::exchange(PreparedMap& prepared) {
  tile_store_ = std::move(prepared.tile_store);
  prepared.map = mapper_.resume(std::move(prepared.map));
  // Before anybody hears of the map whose tiles are there.
  if (outputs_.tiles != nullptr) outputs_.tiles->use_tile_store(tile_store_);
  begin_map(std::move(prepared.path), prepared.seen_until_ns);
}

void MappingThread::begin_map(SharedTrajectory trajectory,
                              const std::optional<std::int64_t>& seen_until_ns) {
  mapper_.static_map().set_frozen(false);
  is_map_frozen_ = false;
  latest_map_.begin(mapper_.map_snapshot(), std::move(trajectory));
  if (odom_) odom_->begin_map();
  prior_.forget_poses();
  if (outputs_.place_finder != nullptr) outputs_.place_finder->forget();
  begin_loops(&LoopCorrector::begin_in_map, seen_until_ns);
  if (outputs_.earth != nullptr) outputs_.earth->forget();
  publish_submaps({});
  if (outputs_.occupancy != nullptr) outputs_.occupancy->begin(latest_map_.view());
}

void MappingThread::begin_loops(void (LoopCorrector::*in_map)(std::int64_t seen_until_ns),
                                const std::optional<std::int64_t>& seen_until_ns) {
  if (outputs_.loops == nullptr) return;
  if (latest_map_.view()->tiles.empty()) return outputs_.loops->begin_map();
  // Nothing tells what was seen before from what is seen from now on.
  if (!seen_until_ns) return outputs_.loops->begin_open();
  (outputs_.loops->*in_map)(*seen_until_ns);
}

void MappingThread::set_elsewhere() {
  if (const auto submaps = outputs_.loops->take_submaps()) publish_submaps(*submaps);
  begin_loops(&LoopCorrector::go_on_in_map, latest_map_.seen_until_ns());
}

void MappingThread::close_loops() {
  if (outputs_.loops == nullptr || is_map_frozen_) return;
  if (outputs_.loops->take_withdrawal() && outputs_.earth != nullptr) outputs_.earth->withdraw();
  if (const auto place = outputs_.loops->take_place(); place && outputs_.earth != nullptr)
    outputs_.earth->publish(latest_map_.newest_pose().stamp_ns, *place);
  if (const auto submaps = outputs_.loops->take_submaps()) publish_submaps(*submaps);
  if (auto correction = outputs_.loops->take()) return corrector_.begin(*std::move(correction));
  if (outputs_.loops->take_full()) begin_loops(&LoopCorrector::settle, latest_map_.seen_until_ns());
}

void MappingThread::publish_submaps(const SubmapList& submaps) {
  if (outputs_.submaps == nullptr) return;
  outputs_.submaps->publish({.map_id = latest_map_.view()->map_id,
                             .frame = map_frame_,
                             .child_frame = frames_.base(),
                             .list = of_frame(submaps, frames_.T_base_lidar().inverse())});
}

bool MappingThread::take_corrected(bool is_idle) {
  if (const auto result = corrector_.take(false)) follow(*result);
  return corrector_.insert_kept([&] { return is_idle && queue_.waiting() == 0; });
}

void MappingThread::follow(const MapCorrector::Result& result) {
  if (!result.corrected) {
    outputs_.loops->end_map();
    statistics_.count("map_corrections_refused");
    spdlog::error(
        "loops stay open: to move what was seen on the way, more of the map would have to be in "
        "memory than map.memory_limit_mib allows");
    return;
  }
  latest_map_.correct(result.correction, result.view);
  if (odom_) odom_->correct_map(result.correction.latest());
  prior_.correct_map(result.correction.latest());
  if (outputs_.place_finder != nullptr) outputs_.place_finder->map_corrected();
  octree_is_behind_ = outputs_.occupancy != nullptr;
  outputs_.loops->report(result.correction, *result.corrected, result.ms);
}

void MappingThread::stop() {
  if (!worker_) return;
  worker_.reset();
  requests_.close([this] {
    end_correction();
    publish_snapshot();
  });
}

void MappingThread::end_correction() {
  if (const auto result = corrector_.take(true)) follow(*result);
  static_cast<void>(corrector_.insert_kept([] { return true; }));
}

RunCheckpoint MappingThread::checkpoint(CheckpointScope scope) {
  MapCheckpoint map;
  SharedTrajectory path;
  std::string datum;
  bool is_withdrawn = false;
  requests_.run([&] {
    if (outputs_.earth != nullptr) {
      datum = outputs_.earth->datum();
      is_withdrawn = outputs_.earth->is_withdrawn();
    }
    const auto began = Clock::now();
    map = mapper_.static_map().checkpoint(scope);
    latest_map_.publish(map.view);
    path = latest_map_.trajectory();
    statistics_.add_latency("checkpoint", milliseconds(Clock::now() - began));
  });
  RunCheckpoint checkpoint{to_saved_map(map), map.step};
  checkpoint.map.trajectory = std::move(path);
  // Empty: not that of the last save either.
  if (!datum.empty() || is_withdrawn) checkpoint.map.metadata["datum"] = datum;
  if (const std::string sensor = statistics_.sensor(); !sensor.empty())
    checkpoint.map.metadata["sensor"] = sensor;
  return checkpoint;
}

void MappingThread::checkpoint_stored(std::uint64_t step) {
  requests_.run([&] {
    mapper_.static_map().checkpoint_stored(step);
    bound_memory();
    if (!is_map_frozen_) return;
    mapper_.static_map().set_frozen(false);
    is_map_frozen_ = false;
    spdlog::info("the map was saved: scans enter it again");
  });
}

void MappingThread::checkpoint_failed() {
  requests_.run([&] {
    bound_memory();
    const bool is_full = mapper_.static_map().memory_use().bytes > map_limit_bytes_;
    if (!is_full || is_map_frozen_) return;
    mapper_.static_map().set_frozen(true);
    is_map_frozen_ = true;
    spdlog::error(
        "the map fills its memory and cannot be saved: scans give poses, but enter neither it "
        "nor the octree");
  });
}

void MappingThread::bound_memory() {
  StaticMap& map = mapper_.static_map();
  map.evict(latest_map_.newest_pose().T_map_lidar.translation(), map_limit_bytes_);
  for (const std::string& fault : map.unreadable_tiles()) {
    throttled_log_.warn("tiles_unreadable", "not mapped there: " + fault);
  }
  statistics_.set_map_memory(map.memory_use(), map.unreadable_tiles().size());
}

MemoryUse MappingThread::memory_use() {
  MemoryUse use;
  requests_.run([&] { use = mapper_.static_map().memory_use(); });
  return use;
}

void MappingThread::stored_is_gone() {
  requests_.run([&] { mapper_.static_map().keep_in_memory(); });
}

void MappingThread::forget_lost_tiles() {
  requests_.run([&] {
    StaticMap& map = mapper_.static_map();
    map.forget_lost();
    publish_snapshot();
    statistics_.set_map_memory(map.memory_use(), map.unreadable_tiles().size());
  });
}

void MappingThread::end_round(bool is_idle) {
  if (!take_corrected(is_idle)) return;
  if (octree_is_behind_ && mapper_.confirmed_scans() == 0) {
    octree_is_behind_ = false;
    publish_snapshot();
    outputs_.occupancy->begin(latest_map_.view());
  }
  requests_.run_waiting();
  if (is_idle || Clock::now() - snapshot_published_ >= publish_period_) publish_snapshot();
  close_loops();
}

void MappingThread::map(QueuedScan queued) {
  std::optional<BackgroundThrottle::ScanInProgress> scan_in_progress;
  if (outputs_.throttle != nullptr) scan_in_progress.emplace(*outputs_.throttle);
  const auto began = Clock::now();
  stage_began_ = began;
  labels_ms_ = 0.0;
  received_ = queued.received;
  statistics_.add_latency("queue", milliseconds(began - queued.received));
  const std::int64_t stamp_ns = queued.scan.stamp_ns;
  // Before the labels are opened, whose images are of the lidar as it stands there.
  if (!locate_lidar(queued)) return drop({"unknown_frame", frames_.missing()});
  if (use_sensor(sensor_of(queued)) && is_live_ && queue_.waiting() > 0)
    return drop({"sensor_told", "the network was made ready for the lidar of this scan"});
  mapper_.set_mount(frames_.T_base_lidar());
  if (frames_.has_base()) mapper_.begin_maps_at(frames_.T_base_lidar());
  // A clock that is being set back: a correction, which tells times apart, is to meet none of after
  // that. Now no scan waits for it: none is mapped until the mapper believes the clock.
  if (corrector_.is_running() && steps_back_ >= steps_of_set_clock) end_correction();
  feed_imu(queued.scan);
  if (outputs_.loops != nullptr) mapper_.hold_resumed_map(outputs_.loops->is_off_earlier_map());
  auto mapped = mapper_.process(std::move(queued.scan), prior_for(stamp_ns));
  if (!mapped) return drop(mapper_.last_rejection());
  steps_back_ = 0;
  imu_report_.update(mapper_.inertial());
  imu_report_.tell(mapper_.levelling());
  const bool unlabelled = mapped->labelled.labels.empty();
  const bool is_set_back = latest_map_.add_pose(
      {stamp_ns, T_map_base(mapped->odometry)}, mapped->odometry.health,
      unlabelled ? "none" : mapper_.label_source(), mapped->odometry.map_entry);
  if (is_set_back) tell_of_set_clock(stamp_ns);
  if (outputs_.place_finder != nullptr)
    outputs_.place_finder->update(stamp_ns, mapped->odometry, mapper_);
  if (mapped->odometry.is_beyond_limits) statistics_.count("poses_beyond_motion_limits");
  statistics_.scan_mapped(mapped->label_provenance);
  if (is_map_frozen_) statistics_.count("scans_not_in_map");
  statistics_.add_latency("total", milliseconds(Clock::now() - queued.received));
  forward(*std::move(mapped));
  statistics_.record_other_stages(milliseconds(Clock::now() - began) - labels_ms_);
}

void MappingThread::tell_of_set_clock(std::int64_t stamp_ns) {
  statistics_.count("clock_set_back");
  spdlog::warn(
      "the clock of the scans was set back, to {} ns: the path until then stays, and goes on from "
      "here as a stretch of its own",
      stamp_ns);
}

void MappingThread::drop(const ScanRejection& rejection) {
  if (rejection.counter == "out_of_order") ++steps_back_;
  statistics_.scans_dropped(rejection.counter, 1, rejection.reason);
  throttled_log_.warn(rejection.counter, "scan dropped: " + rejection.reason);
}

bool MappingThread::locate_lidar(const QueuedScan& queued) {
  if (!frames_.locate_lidar(queued.frame, mapper_.trajectory().empty())) return false;
  const bool is_told = mounted_frame_ == frames_.lidar() || !frames_.is_configured();
  if (is_told || !frames_.has_base() || outputs_.poses == nullptr) return true;
  mounted_frame_ = frames_.lidar();
  outputs_.poses->publish_static(queued.scan.stamp_ns,
                                 {frames_.base(), mounted_frame_, frames_.T_base_lidar()});
  return true;
}

void MappingThread::feed_imu(const Scan& scan) {
  if (outputs_.imu == nullptr) return;
  const SweepTimes sweep = sweep_times(scan, sensor_period_s_);
  const std::int64_t end_ns =
      scan.stamp_ns + std::llround(1e9 * (sweep.middle_s + 0.5 * sweep.duration_s));
  const std::int64_t until_ns = mapper_.inertial().imu_time(end_ns);
  // A server that begins beside its drivers has seen a tenth of a second of samples: too little to
  // level a map by.
  const bool may_level = mapper_.begins_map() && mapper_.inertial().may_tell_up();
  const std::chrono::nanoseconds more(may_level ? InertialTracker::up_window_after_ns : 0);
  for (const ImuSample& sample : outputs_.imu->take(until_ns, more)) mapper_.add(sample);
}

void MappingThread::forward(MappedScan mapped) {
  const auto labelled = std::make_shared<const LabelledScan>(std::move(mapped.labelled));
  const bool enters_map = mapped.odometry.is_confirmed() && !is_map_frozen_;
  // Fewer that have waited are of a place that others show, too.
  constexpr std::size_t scans_of_new_place = 10;
  octree_is_behind_ |= outputs_.occupancy != nullptr && mapped.entered_before >= scans_of_new_place;
  if (outputs_.occupancy != nullptr && enters_map && !octree_is_behind_)
    outputs_.occupancy->add({labelled, mapped.odometry.T_map_lidar, !mapped.unlabelled_may_move});
  if (outputs_.place_finder != nullptr) {
    const bool has_own_labels = mapped.label_provenance == LabelProvenance::fresh;
    outputs_.place_finder->keep_last(labelled, has_own_labels, frames_.T_base_lidar());
  }
  if (outputs_.loops != nullptr)
    outputs_.loops->add(labelled, mapped.T_odom_lidar, frames_.T_base_lidar(),
                        mapped.odometry.map_entry);
  if (outputs_.scans != nullptr) outputs_.scans->publish(labelled, frames_.lidar());
}

std::optional<Eigen::Isometry3d> MappingThread::prior_for(std::int64_t stamp_ns) {
  motion_prior_.reset();
  if (corrector_.is_running()) {
    // What is found in a map that is being corrected must be looked for again.
    mapper_.hand_out_scans(false);
  } else if (outputs_.place_finder != nullptr) {
    if (const auto T_map_lidar = outputs_.place_finder->relocate(mapper_, stamp_ns)) {
      prior_.forget_poses();
      if (outputs_.loops != nullptr) set_elsewhere();
      return T_map_lidar;
    }
  }
  if (mapper_.trajectory().empty()) {
    const Eigen::Isometry3d& T_base_lidar = frames_.T_base_lidar();
    if (const auto way = latest_map_.way_in_loaded_path(stamp_ns); way.size() == 2)
      mapper_.go_on_from(way[0], way[1], T_base_lidar);
    const auto T_map_base_stored = latest_map_.pose_in_loaded_path(stamp_ns);
    if (T_map_base_stored) return *T_map_base_stored * T_base_lidar;
  }
  // It begins where the robot stands, whichever way its lidar looks.
  if (frames_.has_base() && mapper_.begins_map()) return std::nullopt;
  if (!mapper_.trajectory().empty()) {
    motion_prior_ = prior_.lidar_motion(mapper_.trajectory().back().stamp_ns, stamp_ns);
    if (motion_prior_) return mapper_.trajectory().back().T_map_lidar * *motion_prior_;
    if (!mapper_.is_placed()) return mapper_.trajectory().back().T_map_lidar;
    return std::nullopt;
  }
  return frames_.has_base() ? std::optional(frames_.T_base_lidar()) : std::nullopt;
}

void MappingThread::stage_ended(std::string_view stage) {
  const auto now = Clock::now();
  const double ms = milliseconds(now - stage_began_);
  statistics_.add_latency(std::string(stage), ms);
  if (stage == "segment") labels_ms_ = ms;
  stage_began_ = now;
}

void MappingThread::pose_found(std::int64_t stamp_ns, const OdometryResult& odometry) {
  const Eigen::Isometry3d T_lidar_base = frames_.T_base_lidar().inverse();
  prior_.learn(mapper_.trajectory(), stamp_ns, odometry);
  RobotPose pose{
      .stamp_ns = stamp_ns,
      .T_map_base = T_map_base(odometry),
      .covariance = covariance_of_frame(odometry.covariance, odometry.T_map_lidar, T_lidar_base),
      .base_frame = frames_.base(),
      .odom = std::nullopt};
  if (odom_) {
    std::optional<Eigen::Isometry3d> motion_base;
    if (motion_prior_) motion_base = motion_of_frame(frames_.T_base_lidar(), *motion_prior_);
    pose.odom = odom_->update(stamp_ns, pose.T_map_base, odometry.health, motion_base);
  } else if (!odom_frame_.empty()) {
    pose.odom = prior_.pose_in_odom(stamp_ns, pose.T_map_base);
    pose.is_odom_own = false;
  }
  if (outputs_.poses != nullptr) outputs_.poses->publish(pose);
  statistics_.add_latency("pose", milliseconds(Clock::now() - received_));
}

void MappingThread::publish_snapshot() {
  latest_map_.publish(mapper_.map_snapshot());
  snapshot_published_ = Clock::now();
  if (outputs_.occupancy != nullptr && map_limit_bytes_ != no_limit)
    outputs_.occupancy->follow(latest_map_.view());
}

}  // namespace stillmap::server
