#include "clients/commands/mapping/mapping_run.hpp"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <stdexcept>
#include <utility>

#include "clients/commands/mapping/sample_feed.hpp"
#include "clients/commands/mapping/scans_ahead.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/localization/lost_lidar_search.hpp"
#include "core/map/map_id.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap::cli {
namespace {

/// The true ids of the points that the mapper will keep.
std::vector<std::uint16_t> true_ids_of_kept_points(const DatasetFrame& frame,
                                                   const PrepareConfig& prepare) {
  if (frame.raw_labels.empty()) return {};
  std::vector<std::uint16_t> ids;
  for (const std::uint32_t i : usable_points(frame.scan, prepare)) {
    ids.push_back(static_cast<std::uint16_t>(frame.raw_labels[i]));
  }
  return ids;
}

/// One run over a data set: keeps what is reported at its end.
class MappingRun {
 public:
  MappingRun(const MappingTask& task, std::unique_ptr<Segmenter> labels,
             const MappingListeners& listeners)
      : task_(task),
        listeners_(listeners),
        T_body_lidar_(task.body.T_body_lidar),
        scans_(task.dataset, task.config, std::move(labels)),
        mapper_(
            task.config, scans_.segmenter(),
            {.stage_ended = [this](std::string_view stage) { times_.end_stage(stage); },
             .pose_found = {},
             .scan_prepared = [this](const Scan& scan,
                                     const PointLabels& labels) { search_.follow(scan, labels); }}),
        search_(task.config.odometry, task.config.sensor, T_body_lidar_,
                [this] { return mapper_.map_snapshot(); }),
        imu_(task.dataset.imu()) {
    mapper_.reset(new_map_id());
    if (!T_body_lidar_.isApprox(Eigen::Isometry3d::Identity()))
      mapper_.begin_maps_at(T_body_lidar_);
    if (task.loops) loops_.emplace(*task.loops, task.config.sensor);
  }

  /// Goes on where an earlier run was. Throws std::invalid_argument for another voxel size.
  void resume(RunState earlier) {
    mapper_.resume(earlier.map.view, earlier.map.tile_evidence);
    earlier_ = earlier.map.trajectory.to_vector();
    search_.add_path(earlier_);
    if (earlier_.size() > 1)
      mapper_.go_on_from(earlier_[earlier_.size() - 2], earlier_.back(), T_body_lidar_);
    if (loops_) loops_->resume(earlier.next_scan, earlier.scan_of_pose.size());
    result_.scan_of_pose = std::move(earlier.scan_of_pose);
    result_.resumed_at_scan = earlier.next_scan;
  }

  /// Begins with this scan: what an earlier run has kept is of no use.
  void begin(std::size_t first_scan) {
    if (loops_) loops_->resume(first_scan, 0);
  }

  /// Before the first scan: which ones map_scan() will get, in their order.
  void expect(std::size_t first_scan, std::size_t end) { scans_.start(first_scan, end); }

  /// What changed since the last saved state.
  [[nodiscard]] RunState state(std::size_t next_scan) {
    if (loops_) loops_->flush();
    MapCheckpoint checkpoint = mapper_.static_map().checkpoint();
    step_ = checkpoint.step;
    RunState state{to_saved_map(checkpoint), result_.scan_of_pose, next_scan};
    state.map.trajectory = path();
    return state;
  }
  void state_saved() { mapper_.static_map().checkpoint_stored(step_); }

  void map_scan(std::size_t index) {
    std::optional<DatasetFrame> frame = read(index);
    if (!frame) return;
    const std::vector<std::uint16_t> true_ids =
        true_ids_of_kept_points(*frame, task_.config.prepare);
    for (const ImuSample& sample :
         imu_.take_up_to_end_of(frame->scan, task_.config.sensor.period_s))
      mapper_.add(sample);
    times_.begin();
    const auto T_map_lidar_known = prior_for(frame->scan.stamp_ns);
    mapper_.hand_out_scans(search_.is_on());
    const std::optional<MappedScan> mapped =
        mapper_.process(std::move(frame->scan), T_map_lidar_known);
    if (!mapped) {
      skip({index, mapper_.last_rejection().counter,
            task_.dataset.file(index).string() + ": " + mapper_.last_rejection().reason});
      return;
    }
    times_.end();
    forget_dropped_poses();
    result_.scan_of_pose.push_back(index);
    result_.health[mapped->odometry.health] += 1;
    is_registered_ |= mapped->odometry.health != OdometryHealth::lost;
    search_.update(mapped->labelled.scan.stamp_ns, mapped->odometry, mapper_.is_placed());
    if (mapped->begins_elsewhere) result_.found_again_at.push_back(index);
    if (loops_) loops_->add(index, *mapped);
    if (!true_ids.empty())
      result_.moving += evaluation::moving_score(mapped->labelled.motion, true_ids);
  }

  /// Throws std::runtime_error where nothing of a resumed run was found in what it had mapped.
  MappingResult finish(bool stopped) {
    if (!stopped) check_found_again();
    result_.trajectory = result_.odometry = path();
    // Submaps hold dropped poses, too: loops stay open then.
    const bool has_all_scans = loops_ && loops_->scan_count() == result_.trajectory.size();
    if (has_all_scans && !stopped) {
      const bool has_loops = loops_->finish();
      if (task_.earlier_map != nullptr) {
        stopped = !put_onto_earlier_map();
      } else if (has_loops) {
        stopped = !correct();
      }
      if (!stopped) result_.loops = loops_->report();
    } else if (task_.earlier_map != nullptr && !stopped) {
      throw std::invalid_argument(
          "the sequence's stamps were set back, and poses of before were dropped: it cannot be put "
          "onto a map in one piece; map it from the scan on where they are (--start)");
    }
    SavedMap map = to_saved_map(mapper_.static_map().checkpoint(
        result_.session ? CheckpointScope::changed : CheckpointScope::everything));
    result_.view = std::make_shared<const MapSnapshot>(std::move(map.view));
    result_.tile_evidence = std::move(map.tile_evidence);
    result_.label_source = mapper_.label_source();
    result_.imu = mapper_.inertial().counts();
    result_.levelling = mapper_.levelling();
    result_.stages = times_.stages();
    result_.stopped = stopped;
    return std::move(result_);
  }

 private:
  void check_found_again() const {
    // Some scans may be lost in any run.
    constexpr std::size_t min_scans = 10;
    const std::size_t scans = mapper_.trajectory().size();
    if (earlier_.empty() || is_registered_ || scans < min_scans) return;
    throw std::runtime_error(
        "none of the " + std::to_string(scans) +
        " scans since the run was resumed could be registered to what it had mapped before: the "
        "lidar is not where its path leads. Begin anew with --force");
  }

  [[nodiscard]] StampedPose lidar_pose(const StampedPose& body) const {
    return {body.stamp_ns, body.T_map_lidar * T_body_lidar_};
  }

  /// Where the lidar is when it has gone on from the end of the earlier run as it moved there, for
  /// a second at most.
  [[nodiscard]] Eigen::Isometry3d lidar_pose_at(std::int64_t stamp_ns) const {
    const StampedPose last = lidar_pose(earlier_.back());
    if (earlier_.size() < 2) return last.T_map_lidar;
    const StampedPose before_last = lidar_pose(earlier_[earlier_.size() - 2]);
    constexpr double max_ns = 1e9;
    const auto interval_ns = static_cast<double>(last.stamp_ns - before_last.stamp_ns);
    const auto since_ns = static_cast<double>(stamp_ns - last.stamp_ns);
    if (interval_ns <= 0.0 || interval_ns > max_ns || since_ns <= 0.0) return last.T_map_lidar;
    return last.T_map_lidar * scaled_motion(before_last.T_map_lidar.inverse() * last.T_map_lidar,
                                            std::min(since_ns, max_ns) / interval_ns);
  }

  /// Where the next scan is known to be, if anywhere.
  [[nodiscard]] std::optional<Eigen::Isometry3d> prior_for(std::int64_t stamp_ns) {
    if (auto place = search_.take_place()) {
      is_relocated_ = true;
      const Eigen::Isometry3d T_map_lidar = place->T_map_odom * place->odometry.predict(stamp_ns);
      mapper_.relocate(std::move(place->odometry));
      return T_map_lidar;
    }
    // Until the lidar is found in the earlier run's map, every scan is looked for where that leads.
    if (!earlier_.empty() && !is_registered_ && !is_relocated_) return lidar_pose_at(stamp_ns);
    const Trajectory& path = mapper_.trajectory();
    const bool is_to_be_found = !mapper_.is_placed() && !mapper_.begins_map();
    return is_to_be_found && !path.empty() ? std::optional(path.back().T_map_lidar) : std::nullopt;
  }

  /// Where the stamps were set back, the mapper drops the poses of times to come.
  void forget_dropped_poses() {
    const std::size_t before = earlier_.size() + mapper_.trajectory().size() - 1;
    result_.scan_of_pose.resize(std::min(before, result_.scan_of_pose.size()));
  }

  /// Puts the corrected poses, and the map by them, in place of those of the odometry. False where
  /// it was stopped: then these stay.
  [[nodiscard]] bool correct() {
    const auto odometry_view = mapper_.map_snapshot();
    StaticMap map(mapper_.static_map().config());
    map.reset(new_map_id());
    if (!move_scans(loops_->T_map_lidar(), 0, std::move(map))) return false;
    result_.odometry_view = odometry_view;
    return true;
  }

  /// Finds the drive in the earlier map and adds its scans there. False where it was stopped.
  /// Throws MapNotRecognized.
  [[nodiscard]] bool put_onto_earlier_map() {
    const auto began = std::chrono::steady_clock::now();
    const EarlierMap& earlier_map = *task_.earlier_map;
    SessionReport session;
    session.alignment = loops_->align(earlier_map.index(), T_body_lidar_.linear());
    if (!session.alignment.is_recognized()) {
      throw MapNotRecognized(
          "the drive was not recognised in " + earlier_map.file().string() + ": " +
          session.alignment.in_words() +
          "; nothing was written. Where it is of another place, map it by itself, without --onto; "
          "else it must come through the mapped place for some 50 m");
    }
    if (!result_.trajectory.empty())
      session.clock_offset_ns = earlier_map.clock_offset_ns(result_.trajectory.front().stamp_ns);
    StaticMap map(mapper_.static_map().config());
    map.resume(earlier_map.saved().view, earlier_map.saved().tile_evidence);
    map.begin_session();
    if (!move_scans(session.alignment.T_map_lidar, session.clock_offset_ns, std::move(map)))
      return false;
    session.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    result_.session = std::move(session);
    return true;
  }

  /// Makes these the poses of the run, and a map with its scans by them the map. False where it was
  /// stopped: then both are as they were.
  [[nodiscard]] bool move_scans(const std::vector<Eigen::Isometry3d>& T_map_lidar,
                                std::int64_t clock_offset_ns, StaticMap map) {
    assert(T_map_lidar.size() == result_.trajectory.size());
    const bool is_done =
        loops_->insert_into(map, T_map_lidar, clock_offset_ns, [&](std::size_t done) {
          return !listeners_.scan_moved || listeners_.scan_moved(done, T_map_lidar.size());
        });
    if (!is_done) return false;
    for (std::size_t i = 0; i < T_map_lidar.size(); ++i)
      result_.trajectory[i].T_map_lidar = T_map_lidar[i] * T_body_lidar_.inverse();
    mapper_.static_map() = std::move(map);
    return true;
  }

  /// Of the body, with what an earlier run has mapped.
  [[nodiscard]] Trajectory path() const {
    const Eigen::Isometry3d T_lidar_body = T_body_lidar_.inverse();
    Trajectory path = earlier_;
    for (const StampedPose& pose : mapper_.trajectory()) {
      path.push_back({pose.stamp_ns, pose.T_map_lidar * T_lidar_body});
    }
    return path;
  }

  std::optional<DatasetFrame> read(std::size_t index) {
    try {
      return scans_.read();
    } catch (const DatasetError& error) {
      if (task_.range.strict) throw;
      skip({index, "unreadable", error.what()});
      return std::nullopt;
    }
  }

  void skip(SkippedScan scan) {
    if (listeners_.scan_skipped) listeners_.scan_skipped(scan);
    result_.skipped.push_back(std::move(scan));
  }

  const MappingTask& task_;
  const MappingListeners& listeners_;
  Eigen::Isometry3d T_body_lidar_;
  StageStopwatch times_;
  ScansAhead scans_;
  Mapper mapper_;
  LostLidarSearch search_;
  std::optional<LoopCorrection> loops_;
  SampleFeed<ImuSample> imu_;
  Trajectory earlier_;
  bool is_registered_ = false;
  /// It was found in the whole map.
  bool is_relocated_ = false;
  std::uint64_t step_ = 0;
  MappingResult result_;
};

/// Throws std::invalid_argument where an earlier run has mapped more scans than are asked for now.
void check_resumed(std::size_t next_scan, const ScanRange& range, std::size_t end) {
  if (next_scan <= end) return;
  const std::string seen = std::to_string(next_scan - range.first);
  throw std::invalid_argument("the unfinished run has seen " + seen + " scans from number " +
                              std::to_string(range.first) + " on, more than the " +
                              std::to_string(end - range.first) + " that are asked for: ask for " +
                              seen + " or more (--scans), or begin anew with --force");
}

}  // namespace

MappingResult map_dataset(const MappingTask& task, std::unique_ptr<Segmenter> labels,
                          RunFile& run_file, const MappingListeners& listeners) {
  const ScanRange& range = task.range;
  const std::size_t end = range.end(task.dataset);
  std::size_t index = range.first;
  MappingRun run(task, std::move(labels), listeners);
  // The map of a few scans is too thin to be found in, and soon made again.
  constexpr std::size_t min_resumed_scans = 10;
  if (auto earlier = run_file.earlier();
      earlier && earlier->scan_of_pose.size() >= min_resumed_scans) {
    index = earlier->next_scan;
    check_resumed(index, range, end);
    run.resume(*std::move(earlier));
  } else {
    run.begin(index);
  }
  const auto began = std::chrono::steady_clock::now();
  bool is_stopped = false;
  run.expect(index, end);
  while (index < end && !is_stopped) {
    run.map_scan(index++);
    is_stopped = listeners.scan_done && !listeners.scan_done(index - range.first) && index < end;
    // At the end, too, where loops are closed next: that may take minutes, and be stopped.
    const bool is_before_correction = index == end && task.loops.has_value();
    if (!is_before_correction && (index == end || !(is_stopped || run_file.is_due()))) continue;
    run_file.save(run.state(index));
    run.state_saved();
  }
  MappingResult result = run.finish(is_stopped);
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return result;
}

}  // namespace stillmap::cli
