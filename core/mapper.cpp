#include "core/mapper.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <stdexcept>
#include <utility>

#include "core/frames/rigid_motion.hpp"
#include "core/lidar/rings.hpp"
#include "core/map/voxel_grid.hpp"
#include "core/odometry/unconfirmed_stretch.hpp"

namespace stillmap {
namespace {

/// How far the lidar moves before points of a resumed map are added to the local map again; less
/// than it sees [m].
constexpr double prior_map_update_distance_m = 20.0;

/// How far from where it was found a lidar may have driven, until the next scan [m].
constexpr double relocation_reach_m = 4.0;

std::vector<TileId> tile_ids(const MapSnapshot& view) {
  std::vector<TileId> ids;
  for (const auto& tile : view.tiles) ids.push_back(tile->info.id);
  return ids;
}

/// Voxels of those of `tiles` (ascending) that reach within `range_m` of a position, in another
/// frame.
std::vector<LabelledPoint> points_near(
    const MapSnapshot& view, std::span<const TileId> tiles, const Eigen::Vector3d& position_map,
    double range_m, const Eigen::Isometry3d& T_frame_map = Eigen::Isometry3d::Identity()) {
  std::vector<LabelledPoint> points;
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(range_m);
  for (const auto& tile : tiles_in_box(view, {position_map - reach, position_map + reach})) {
    if (!std::ranges::binary_search(tiles, tile->info.id)) continue;
    const Eigen::AlignedBox3d bounds_map = tile->info.bounds_map.cast<double>();
    if (bounds_map.exteriorDistance(position_map) > range_m) continue;
    for (const Voxel& voxel : tile->voxels) {
      const Eigen::Vector3d p = T_frame_map * voxel.mean_map.cast<double>();
      points.push_back({p.cast<float>(), voxel.evidence.winner()});
    }
  }
  return points;
}

MapperConfig checked(const MapperConfig& config) {
  if (const std::string faults = config.faults(); !faults.empty())
    throw std::invalid_argument(faults);
  return config;
}

/// Robots stand on slopes that are less steep; a lidar alone may lie on its side.
constexpr double max_tilt_of_robot_rad = std::numbers::pi / 3.0;
constexpr double max_doubtless_tilt_rad = 2.0 * std::numbers::pi / 3.0;

double tilt_of(const Eigen::Vector3d& up) { return std::acos(std::clamp(up.z(), -1.0, 1.0)); }

/// Whether the largest level face of a scan, which is the ground, is above the lidar by this `up`.
bool has_floor_above(const Scan& scan, const Eigen::Vector3d& up_lidar) {
  constexpr double layer_m = 0.2;
  constexpr double max_height_m = 5.0;
  constexpr int layers = static_cast<int>(max_height_m / layer_m);
  /// A ceiling may be seen as well as the floor.
  constexpr double clearly = 1.5;
  std::array<std::size_t, layers> above{}, below{};
  for (const Eigen::Vector3f& point : scan.points_lidar) {
    const double height_m = point.cast<double>().dot(up_lidar);
    const auto layer = static_cast<std::size_t>(std::abs(height_m) / layer_m);
    if (layer > 0 && layer < above.size()) ++(height_m > 0.0 ? above : below).at(layer);
  }
  return static_cast<double>(std::ranges::max(above)) >
         clearly * static_cast<double>(std::ranges::max(below));
}

}  // namespace

ResumedMap ResumedMap::of(StaticMap map) {
  std::vector<TileId> tiles = tile_ids(*map.view());
  return {std::move(map), std::move(tiles), std::nullopt};
}

ResumedMap ResumedMap::of(StaticMap map, const Eigen::Vector3d& position_map,
                          const MapperConfig& config) {
  map.reload_near(position_map);
  ResumedMap resumed = of(std::move(map));
  std::vector<LabelledPoint> points_map =
      points_near(*resumed.map.view(), resumed.tiles, position_map, config.static_map.max_range_m);
  resumed.begin = Begin{position_map, {std::move(points_map), config.odometry.local_map}};
  return resumed;
}

std::string MapperConfig::faults() const {
  return sensor.faults() + odometry.faults() + static_map.faults();
}

Mapper::Mapper(const MapperConfig& config, std::unique_ptr<Segmenter> segmenter,
               MapperListeners listeners)
    : Mapper(config, std::make_unique<BlockingSegmenter>(std::move(segmenter)),
             std::move(listeners)) {}

Mapper::Mapper(const MapperConfig& config, std::unique_ptr<SegmentationPipeline> segmentation,
               MapperListeners listeners)
    : config_(checked(config)),
      listeners_(std::move(listeners)),
      label_synchronizer_(std::move(segmentation), config.sensor),
      inertial_(config.sensor.imu),
      odometry_(config.odometry, config.sensor),
      static_map_(config.static_map, config.sensor) {}

void Mapper::use_sensor(const MapperConfig& config,
                        std::unique_ptr<SegmentationPipeline> segmentation) {
  config_ = checked(config);
  label_synchronizer_ = LabelSynchronizer(std::move(segmentation), config.sensor);
  odometry_.use_sensor(config.sensor);
  static_map_.use_sensor(config.sensor);
}

std::optional<MappedScan> Mapper::process(
    Scan raw_scan, const std::optional<Eigen::Isometry3d>& T_map_lidar_prior) {
  if (!accepts(raw_scan)) return std::nullopt;

  // Prepare: beam of every point where odometry asks for it, then only points that are
  // measurements.
  if (odometry_.uses_rings()) raw_scan.ring = assign_rings(raw_scan, config_.sensor);
  Scan scan = drop_unusable_points(std::move(raw_scan), config_.prepare);
  turn_up(scan, config_.sensor.elevation_offset);
  if (!has_enough_points(scan)) return std::nullopt;
  end_stage("prepare");

  // Label: asks for the class of every point. Late labels of an earlier scan enter the map here.
  LabelSynchronizer::Submission submission = label_synchronizer_.submit(scan, static_map_);

  // Deskew, and labels for the points where they are now expected.
  if (!config_.prepare.deskew) scan.time_offset_s.clear();
  const SweepTimes sweep = sweep_times(scan, config_.sensor.period_s);
  const std::int64_t middle_ns = scan.stamp_ns + std::llround(sweep.middle_s * 1e9);
  if (trajectory_.empty() || scans_to_confirm_ > 0)
    odometry_.expect_first_scan(middle_ns, middle_ns - scan.stamp_ns);
  const std::optional<Scan> with_times = hands_out_scans_ ? std::optional(scan) : std::nullopt;
  const std::optional<InertialMotion> inertial = inertial_motion(scan.stamp_ns, sweep);
  odometry_.sweep_motion(sweep, inertial).move_to_middle(scan, sweep);
  const auto T_odom_lidar_known = in_odometry_frame(levelled(T_map_lidar_prior, scan, sweep));
  const Eigen::Isometry3d T_map_lidar_expected =
      T_map_odom_ * T_odom_lidar_known.value_or(odometry_.predict(middle_ns, inertial));
  LabelSynchronizer::Labels labels = label_synchronizer_.labels_for(
      scan, std::move(submission), T_map_lidar_expected, static_map_.readable());
  if (with_times && listeners_.scan_prepared) {
    const bool are_own = labels.provenance == LabelProvenance::fresh;
    listeners_.scan_prepared(*with_times, are_own ? labels.labels : PointLabels{});
  }
  end_stage("segment");

  // Register: the pose, and what moves.
  add_prior_map_near(T_map_lidar_expected.translation());
  Odometry::Step step =
      odometry_.register_scan(scan, sweep, labels.labels, T_odom_lidar_known, inertial);
  const Eigen::Isometry3d T_odom_lidar = step.result.T_map_lidar;
  move_to_map(step.result);
  const bool begins_elsewhere = confirm_relocation(step.result);
  teach_inertial(middle_ns, step);
  is_placed_ |= step.result.health != OdometryHealth::lost;
  end_stage("odometry");
  if (listeners_.pose_found) listeners_.pose_found(scan.stamp_ns, step.result);

  // Insert: the static map takes what stands still, once the scan's labels are final.
  MappedScan mapped{step.result,
                    labels.provenance,
                    {std::move(scan), std::move(labels.labels), std::move(step.motion)},
                    labels.unlabelled_may_move(),
                    T_odom_lidar,
                    0,
                    begins_elsewhere};
  mapped.entered_before = enter_map(mapped, labels);
  remember({mapped.labelled.scan.stamp_ns, step.result.T_map_lidar});
  end_stage("static_map");
  return mapped;
}

std::size_t Mapper::enter_map(const MappedScan& mapped, const LabelSynchronizer::Labels& labels) {
  const OdometryResult& odometry = mapped.odometry;
  label_synchronizer_.decide_waiting(odometry.map_entry);
  const std::size_t entered = static_map_.decide_waiting(odometry.map_entry, keeps_confirmed_);
  const bool waits = odometry.map_entry == MapEntry::waits;
  if (waits || odometry.is_confirmed())
    label_synchronizer_.insert(mapped.labelled, labels, odometry.T_map_lidar, waits, static_map_);
  return entered;
}

void Mapper::remember(const StampedPose& pose) {
  trajectory_.push_back(pose);
  if (trajectory_.size() <= 2 * max_poses_) return;
  trajectory_.erase(trajectory_.begin(),
                    trajectory_.end() - static_cast<std::ptrdiff_t>(max_poses_));
}

std::optional<Eigen::Isometry3d> Mapper::in_odometry_frame(
    const std::optional<Eigen::Isometry3d>& T_map_lidar) const {
  if (!T_map_lidar) return std::nullopt;
  return T_map_odom_.inverse() * *T_map_lidar;
}

void Mapper::move_to_map(OdometryResult& result) const {
  result.T_map_lidar = T_map_odom_ * result.T_map_lidar;
  result.covariance = turned_covariance(result.covariance, T_map_odom_.linear());
}

void Mapper::reclaim_static_map(const MapCorrection* correction) {
  static_map_.reclaim();
  if (correction == nullptr) return;
  for (StampedPose& pose : trajectory_) {
    if (const auto* const T_new_old = correction->at(pose.stamp_ns))
      pose.T_map_lidar = *T_new_old * pose.T_map_lidar;
  }
  label_synchronizer_.correct(*correction);
  static_map_.correct(*correction);
  T_map_odom_ = correction->latest() * T_map_odom_;
  // What was stored before lies elsewhere in the odometry's frame now.
  prior_map_added_at_map_.reset();
  tiles_reloaded_at_map_.reset();
}

std::optional<InertialMotion> Mapper::inertial_motion(std::int64_t stamp_ns,
                                                      const SweepTimes& sweep) {
  if (!last_middle_) return std::nullopt;
  return inertial_.motion(last_middle_->stamp_ns, stamp_ns, sweep);
}

std::optional<Eigen::Isometry3d> Mapper::levelled(
    const std::optional<Eigen::Isometry3d>& T_map_lidar_prior, const Scan& scan,
    const SweepTimes& sweep) {
  if (!begins_map()) return T_map_lidar_prior;
  const bool may_tell = inertial_.has_samples();
  if (T_map_lidar_prior) {
    if (may_tell) levelling_ = Levelling{.fault = "its first pose is given", .map = maps_begun_};
    return T_map_lidar_prior;
  }
  if (!may_tell) return T_base_lidar_;
  UpDirection up = inertial_.up_lidar(
      scan.stamp_ns + std::llround((sweep.middle_s + 0.5 * sweep.duration_s) * 1e9));
  if (up.up_lidar) up.fault = fault_of_up(*up.up_lidar, scan);
  levelling_ = Levelling{.fault = up.fault, .map = maps_begun_};
  if (!up.up_lidar) return T_base_lidar_;
  levelling_->tilt_rad = tilt_of(*up.up_lidar);
  if (!up.fault.empty()) return T_base_lidar_;
  const Eigen::Isometry3d T_base_lidar = T_base_lidar_.value_or(Eigen::Isometry3d::Identity());
  return levelling_rotation(T_base_lidar.linear() * *up.up_lidar) * T_base_lidar;
}

std::string Mapper::fault_of_up(const Eigen::Vector3d& up_lidar, const Scan& scan) const {
  const Eigen::Vector3d up =
      T_base_lidar_ ? Eigen::Vector3d(T_base_lidar_->linear() * up_lidar) : up_lidar;
  if (tilt_of(up) <= (T_base_lidar_ ? max_tilt_of_robot_rad : max_doubtless_tilt_rad)) return "";
  // A robot does not begin on its side. A lidar alone may hang from anything, above what it sees.
  if (!T_base_lidar_ && !has_floor_above(scan, up_lidar)) return "";
  return "by it the " + std::string(T_base_lidar_ ? "robot" : "lidar") + " leans by " +
         std::to_string(std::lround(tilt_of(up) * 180.0 / std::numbers::pi)) + " degrees, and " +
         (T_base_lidar_ ? "its mount" : "the ground in its scan") +
         " says otherwise: its accelerations point down at rest (they must point up), or 'imu' in "
         "the sensor's file is wrong";
}

void Mapper::teach_inertial(std::int64_t middle_ns, const Odometry::Step& step) {
  if (step.result.health == OdometryHealth::lost) {
    // A gyro that went wrong would warp every scan, and none would ever show that it did.
    constexpr int max_lost_scans = 3;
    if (++lost_scans_ >= max_lost_scans) inertial_.withdraw_belief();
    return inertial_.forget_motion();
  }
  lost_scans_ = 0;
  const Eigen::Isometry3d& T_map_lidar = step.T_map_lidar_middle;
  if (last_middle_ && step.result.health != OdometryHealth::initialised) {
    const Eigen::Matrix3d R_last_middle =
        last_middle_->T_map_lidar.linear().transpose() * T_map_lidar.linear();
    const bool is_good = step.result.health == OdometryHealth::good;
    if (is_good) {
      inertial_.learn(last_middle_->stamp_ns, middle_ns, R_last_middle);
    } else {
      inertial_.judge(last_middle_->stamp_ns, middle_ns, R_last_middle);
    }
  }
  last_middle_ = StampedPose{middle_ns, T_map_lidar};
}

bool Mapper::accepts(const Scan& scan) {
  if (scan.empty()) {
    last_rejection_ = {"empty", "the scan has no points"};
    return false;
  }
  if (trajectory_.empty() || clock_.accepts(scan.stamp_ns, trajectory_.back().stamp_ns)) {
    follow_clock(scan.stamp_ns);
    // A clock that was set back: poses of times to come would stand between those to be added.
    while (!trajectory_.empty() && trajectory_.back().stamp_ns >= scan.stamp_ns)
      trajectory_.pop_back();
    return true;
  }
  const std::int64_t last_ns = trajectory_.back().stamp_ns;
  last_rejection_ =
      scan.stamp_ns <= last_ns
          ? ScanRejection{"out_of_order", "the scan's stamp " + std::to_string(scan.stamp_ns) +
                                              " ns is not after the last one, " +
                                              std::to_string(last_ns) + " ns"}
          : ScanRejection{"time_jump", "the scan's stamp " + std::to_string(scan.stamp_ns) +
                                           " ns is far after the last one, " +
                                           std::to_string(last_ns) +
                                           " ns: the next scans must confirm it"};
  return false;
}

void Mapper::follow_clock(std::int64_t stamp_ns) {
  if (trajectory_.empty() || stamp_ns > trajectory_.back().stamp_ns) return;
  // The first scan by the new clock came a period after the last one by the old.
  const std::int64_t last_ns =
      clock_.first_doubtful_ns() - std::llround(config_.sensor.period_s * 1e9);
  const std::int64_t shift_ns = last_ns - trajectory_.back().stamp_ns;
  odometry_.set_clock(shift_ns);
  if (last_middle_) last_middle_->stamp_ns += shift_ns;
}

bool ScanClock::accepts(std::int64_t stamp_ns, std::int64_t last_ns) {
  const auto follows = [stamp_ns](std::int64_t before_ns) {
    return stamp_ns > before_ns && stamp_ns - before_ns <= max_step_ns;
  };
  if (follows(last_ns)) {
    doubtful_scans_ = 0;
    return true;
  }
  doubtful_scans_ = doubtful_scans_ > 0 && follows(doubtful_ns_) ? doubtful_scans_ + 1 : 1;
  if (doubtful_scans_ == 1) first_doubtful_ns_ = stamp_ns;
  doubtful_ns_ = stamp_ns;
  const int needed = stamp_ns > last_ns ? scans_after_jump : scans_after_step_back;
  if (doubtful_scans_ < needed) return false;
  doubtful_scans_ = 0;
  return true;
}

bool Mapper::has_enough_points(const Scan& scan) {
  const auto at_first_place = [&](const Eigen::Vector3f& p) { return p == scan.points_lidar[0]; };
  if (!scan.empty() && std::ranges::all_of(scan.points_lidar, at_first_place)) {
    last_rejection_ = {"too_few_points", std::to_string(scan.size()) +
                                             " usable points are all at one place: that is a "
                                             "broken driver, not a scan"};
    return false;
  }
  if (scan.size() >= min_usable_points) return true;
  last_rejection_ = {"too_few_points",
                     std::to_string(scan.size()) +
                         " points are left after those that are not finite, nearer than " +
                         std::to_string(config_.prepare.min_range_m) + " m, farther than " +
                         std::to_string(config_.prepare.max_range_m) +
                         " m or on the robot itself; at least " +
                         std::to_string(min_usable_points) + " are needed"};
  return false;
}

void Mapper::resume(const MapSnapshot& view, const TileEvidenceMap& tile_evidence) {
  StaticMap prepared(config_.static_map);
  prepared.resume(view, tile_evidence);
  static_cast<void>(resume(ResumedMap::of(std::move(prepared))));
}

ResumedMap Mapper::resume(ResumedMap prepared) {
  ResumedMap until_now{std::exchange(static_map_.map(), std::move(prepared.map)),
                       std::exchange(resumed_tiles_, {}), std::exchange(begin_, std::nullopt)};
  clear_scan_state();
  resumed_tiles_ = std::move(prepared.tiles);
  begin_ = std::move(prepared.begin);
  return until_now;
}

void Mapper::reset(std::uint64_t map_id) {
  static_map_.map().reset(map_id);
  clear_scan_state();
}

void Mapper::clear_scan_state() {
  odometry_.begin_map();
  T_map_odom_ = Eigen::Isometry3d::Identity();
  label_synchronizer_.reset();
  static_map_.forget_kept();
  trajectory_.clear();
  last_middle_.reset();
  inertial_.forget_motion();
  levelling_.reset();
  ++maps_begun_;
  clock_ = {};
  resumed_tiles_ = {};
  prior_map_added_at_map_.reset();
  tiles_reloaded_at_map_.reset();
  begin_.reset();
  is_resumed_map_held_ = false;
  is_placed_ = false;
  scans_to_confirm_ = 0;
}

void Mapper::relocate(Odometry followed, int confirming_scans) {
  odometry_ = std::move(followed);
  T_map_odom_ = Eigen::Isometry3d::Identity();
  odometry_.begin_map(relocation_reach_m);
  scans_to_confirm_ = confirming_scans;
  confirming_scans_ = 0;
  is_placed_ = false;
  last_middle_.reset();
  inertial_.forget_motion();
  // Of this run, too.
  resumed_tiles_ = tile_ids(*static_map_.map().view());
  prior_map_added_at_map_.reset();
  tiles_reloaded_at_map_.reset();
  begin_.reset();
  is_resumed_map_held_ = false;
}

bool Mapper::confirm_relocation(OdometryResult& result) {
  if (scans_to_confirm_ == 0) return false;
  const bool fits = result.health == OdometryHealth::good && result.is_confirmed();
  confirming_scans_ = fits ? confirming_scans_ + 1 : 0;
  if (confirming_scans_ >= scans_to_confirm_) {
    scans_to_confirm_ = 0;
    return true;
  }
  result.map_entry = MapEntry::stays_out_with_waiting;
  if (fits) result.health = OdometryHealth::degenerate;
  // It looks as if it were known to centimetres, or it is in another place.
  result.covariance = unknown_pose_covariance();
  return false;
}

void Mapper::add_prior_map_near(const Eigen::Vector3d& position_map) {
  if (resumed_tiles_.empty() || static_map_.is_lent()) return;
  const auto is_near = [&](const std::optional<Eigen::Vector3d>& place_map) {
    return place_map && (position_map - *place_map).norm() < prior_map_update_distance_m;
  };
  if (begin_ && !is_resumed_map_held_ && is_near(begin_->position_map)) {
    prior_map_added_at_map_ = tiles_reloaded_at_map_ = begin_->position_map;
    odometry_.begin_in(std::move(begin_->prior));
  }
  begin_.reset();
  StaticMap& map = static_map_.map();
  if (!is_near(tiles_reloaded_at_map_)) {
    tiles_reloaded_at_map_ = position_map;
    map.reload_near(position_map);
  }
  if (is_resumed_map_held_ || is_near(prior_map_added_at_map_)) return;
  prior_map_added_at_map_ = position_map;
  odometry_.add_prior_map(points_near(*map.view(), resumed_tiles_, position_map,
                                      config_.static_map.max_range_m, T_map_odom_.inverse()));
}

void Mapper::end_stage(std::string_view stage) const {
  if (listeners_.stage_ended) listeners_.stage_ended(stage);
}

}  // namespace stillmap
