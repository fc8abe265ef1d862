#include "server/mapping/loop_corrector.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <utility>

#include "server/mapping/milliseconds.hpp"
#include "server/threads/background_throttle.hpp"

namespace stillmap::server {
namespace {

/// A search takes a second or two, in which a lidar sends so many scans.
constexpr std::size_t max_waiting_scans = 20;
/// A minute at 10 Hz.
constexpr std::size_t max_waiting_fixes = 600;

/// Submaps of one run after those of another one in the same map.
SubmapList after(SubmapList earlier, const SubmapList& later) {
  const std::size_t known = earlier.submaps.size();
  const double way_m = known == 0 ? 0.0 : earlier.submaps.back().way_m;
  earlier.graph_revision += later.graph_revision;
  for (SubmapList::Entry submap : later.submaps) {
    submap.way_m += way_m;
    earlier.submaps.push_back(submap);
  }
  for (SubmapList::Loop loop : later.loops) {
    loop.from += known;
    loop.to += known;
    earlier.loops.push_back(loop);
  }
  return earlier;
}

}  // namespace

LoopCorrector::LoopCorrector(const LiveLoopConfig& config, bool is_lossless, Statistics& statistics,
                             SeenUntil seen_until, const Eigen::Vector3d& antenna_base)
    : config_(config),
      is_lossless_(is_lossless),
      statistics_(statistics),
      seen_until_(std::move(seen_until)),
      antenna_base_(antenna_base),
      scans_(max_waiting_scans) {
  worker_.emplace(
      "loops", scans_, [this](const ScanOfMap& scan) { look_at(scan); },
      WorkerOptions{
          .on_start = [] { static_cast<void>(use_scheduling(BackgroundScheduling::low)); },
          .on_failure = [this] { failed_.request_stop(); }});
}

void LoopCorrector::begin_another(Run run) {
  run.map = ++maps_;
  T_map_odom_.setIdentity();
  last_stamp_ns_ = std::numeric_limits<std::int64_t>::min();
  is_clock_set_back_ = false;
  is_past_unknown_ = false;
  begin(run, {});
}

void LoopCorrector::begin_open() {
  spdlog::warn("loops stay open: the map that was loaded has no path");
  is_past_unknown_ = true;
  begin({}, {});
}

void LoopCorrector::go_on_in_map(std::int64_t seen_until_ns) {
  T_map_odom_.setIdentity();
  settle(seen_until_ns);
}

void LoopCorrector::settle(std::int64_t seen_until_ns) {
  // Of before and after that, the same stamps would be.
  if (is_clock_set_back_ || is_past_unknown_) return end_map();
  begin({.map = ++maps_, .earlier_until_ns = seen_until_ns, .T_map_odom = T_map_odom_},
        std::move(told_));
}

void LoopCorrector::begin(Run run, SubmapList submaps) {
  run_ = run;
  // The worker frees what it kept of the last one.
  scans_.edit([](std::deque<ScanOfMap>& scans) {
    scans.clear();
    scans.emplace_back();
  });
  const std::scoped_lock lock(mutex_);
  found_.reset();
  place_.reset();
  submaps_.reset();
  full_.reset();
  told_ = earlier_submaps_ = std::move(submaps);
  map_revision_ = 0;
  is_off_earlier_map_ = false;
}

void LoopCorrector::add(const GnssFix& fix) {
  const std::scoped_lock lock(mutex_);
  // Nobody looks at scans: there are none, or loops stay open.
  if (fixes_.size() >= max_waiting_fixes) {
    fixes_.erase(fixes_.begin());
    statistics_.count("gnss_fixes_unused");
  }
  fixes_.push_back(fix);
}

void LoopCorrector::add(std::shared_ptr<const LabelledScan> labelled,
                        const Eigen::Isometry3d& T_odom_lidar,
                        const Eigen::Isometry3d& T_base_lidar, MapEntry entry) {
  const std::int64_t stamp_ns = labelled->scan.stamp_ns;
  if (stamp_ns <= std::exchange(last_stamp_ns_, stamp_ns)) is_clock_set_back_ = true;
  if (run_.map == 0) return;
  ScanOfMap scan{run_, std::move(labelled), run_.T_map_odom * T_odom_lidar,
                 T_base_lidar.inverse() * antenna_base_, entry};
  if (is_lossless_) {
    // The worker outlives mapping: there is nothing else to stop for.
    static_cast<void>(scans_.push_blocking(std::move(scan), failed_.get_token()));
    return;
  }
  const std::size_t left_out = scans_.push_dropping_oldest(std::move(scan));
  if (left_out > 0) statistics_.count("scans_not_in_loops", left_out);
}

std::optional<MapCorrection> LoopCorrector::take() {
  const std::scoped_lock lock(mutex_);
  auto found = std::exchange(found_, std::nullopt);
  if (!found || found->map != run_.map || is_clock_set_back_) return std::nullopt;
  taken_revision_ = found->graph_revision;
  return std::move(found->correction);
}

std::optional<MapOnEarth> LoopCorrector::take_place() {
  const std::scoped_lock lock(mutex_);
  if (!place_ || place_->map != run_.map || place_->graph_revision != map_revision_)
    return std::nullopt;
  return std::exchange(place_, std::nullopt)->place;
}

bool LoopCorrector::take_withdrawal() {
  const std::scoped_lock lock(mutex_);
  const std::uint64_t map = std::exchange(withdrawn_map_, 0);
  return map != 0 && map == run_.map;
}

bool LoopCorrector::is_off_earlier_map() {
  const std::scoped_lock lock(mutex_);
  if (is_clock_set_back_) return false;
  const auto& [map, is_off, graph_revision] = off_earlier_map_;
  if (map == run_.map && graph_revision == map_revision_) is_off_earlier_map_ = is_off;
  return is_off_earlier_map_;
}

bool LoopCorrector::take_full() {
  const std::scoped_lock lock(mutex_);
  if (!full_ || full_->map != run_.map || full_->graph_revision != map_revision_) return false;
  full_.reset();
  return true;
}

std::optional<SubmapList> LoopCorrector::take_submaps() {
  const std::scoped_lock lock(mutex_);
  if (!submaps_ || submaps_->map != run_.map || submaps_->list.graph_revision != map_revision_)
    return std::nullopt;
  told_ = after(earlier_submaps_, std::exchange(submaps_, std::nullopt)->list);
  return told_;
}

void LoopCorrector::report(const MapCorrection& correction, const CorrectedMap& corrected,
                           double ms) {
  map_revision_ = taken_revision_;
  T_map_odom_ = correction.latest() * T_map_odom_;
  statistics_.count("map_corrections");
  statistics_.add_latency("correction", ms);
  spdlog::info(
      "map corrected in {:.0f} ms: {} voxels moved, {} tiles changed; the robot by {:.2f} m", ms,
      corrected.moved_voxels, corrected.changed_tiles,
      MapCorrection::max_shift_m(correction.poses().back(), 0.0));
}

void LoopCorrector::look_at(const ScanOfMap& scan) {
  if (scan.labelled == nullptr) {
    closer_.reset();
    waiting_.clear();
    closed_map_ = 0;
    return;
  }
  for (const ScanOfMap& waited : waiting_.decided_by(scan.entry)) close(waited, true);
  if (scan.entry == MapEntry::waits)
    return waiting_.add(scan, scan.T_odom_lidar.translation(), scan.labelled->scan.size());
  // The closer takes scans in their order.
  if (waiting_.empty()) close(scan, is_confirmed(scan.entry));
}

void LoopCorrector::close(const ScanOfMap& scan, bool enters) {
  const std::uint64_t map = scan.run.map;
  if (std::exchange(closed_map_, map) != map) {
    closer_.emplace(closer_for(scan.run));
    reported_ = reported_anchors_ = reported_placed_ = reported_misplaced_ = handed_on_submaps_ = 0;
    reported_doubted_ = 0;
    reported_delay_s_ = config_.gnss.delay_s.value_or(0.0);
    had_place_ = false;
  }
  const auto began = std::chrono::steady_clock::now();
  const bool had_ended = !closer_->end_reason().empty();
  hand_on_fixes(scan.run);
  auto correction = closer_->add(*scan.labelled, scan.T_odom_lidar, enters, scan.antenna_lidar);
  statistics_.add_latency("loops", milliseconds(std::chrono::steady_clock::now() - began));
  if (!had_ended && !closer_->end_reason().empty() && !closer_->is_full())
    spdlog::warn("loops stay open from here on: {}", closer_->end_reason());
  report_fixes();
  report_closures();
  hand_on_submaps(map);
  hand_on_place(map);
  const std::scoped_lock lock(mutex_);
  off_earlier_map_ = {map, closer_->is_off_earlier_map(), closer_->corrections()};
  if (closer_->is_full()) full_ = {map, closer_->corrections()};
  if (!correction) return;
  // Of two that were not taken yet the second is of the map after the first.
  if (found_ && found_->map == map) correction = combined(found_->correction, *correction);
  found_ = Found{map, *std::move(correction), closer_->corrections()};
}

LiveLoopCloser LoopCorrector::closer_for(const Run& run) const {
  if (!run.earlier_until_ns) return LiveLoopCloser(config_);
  const std::int64_t until_ns = *run.earlier_until_ns;
  EarlierMap earlier([this, until_ns](const Eigen::Vector2d& position_map, double radius_m) {
    return seen_until_(until_ns, position_map, radius_m);
  });
  return {config_, std::move(earlier), until_ns};
}

void LoopCorrector::hand_on_submaps(std::uint64_t map) {
  const std::size_t submaps = closer_->submap_count();
  if (submaps == std::exchange(handed_on_submaps_, submaps)) return;
  SubmapList list = closer_->submaps();
  const std::scoped_lock lock(mutex_);
  submaps_ = Submaps{map, std::move(list)};
}

void LoopCorrector::hand_on_fixes(const Run& run) {
  std::vector<GnssFix> fixes;
  {
    const std::scoped_lock lock(mutex_);
    fixes.swap(fixes_);
  }
  if (!closer_->end_reason().empty()) {
    if (!fixes.empty()) statistics_.count("gnss_fixes_unused", fixes.size());
    return;
  }
  if (run.earlier_until_ns) {
    // Where an earlier map lies on the earth is known to who made it.
    if (fixes.empty()) return;
    statistics_.count("gnss_fixes_unused", fixes.size());
    if (std::exchange(map_without_fixes_, run.map) != run.map) {
      spdlog::warn(
          "GNSS: fixes are not used from here on: this part of the drive is held by the map from "
          "before it, which was loaded, or in which the robot was found again");
    }
    return;
  }
  for (const GnssFix& fix : fixes) {
    const std::size_t origins = closer_->gnss().origins();
    const std::string refusal = closer_->add(fix);
    if (origins > 0 && closer_->gnss().origins() != origins) {
      spdlog::warn(
          "GNSS: the fixes until now are dropped, as more that followed them lie together more "
          "than "
          "50 km away");
    }
    if (refusal.empty()) continue;
    statistics_.count("gnss_fixes_refused");
    throttled_log_.warn("gnss", "a GNSS fix is not used: " + refusal);
  }
}

void LoopCorrector::hand_on_place(std::uint64_t map) {
  // What was found until then stays.
  if (!closer_->end_reason().empty()) return;
  const auto place = closer_->on_earth();
  const bool had_place = std::exchange(had_place_, place.has_value());
  const std::scoped_lock lock(mutex_);
  if (place) {
    place_ = Place{map, *place, closer_->corrections()};
  } else if (had_place) {
    // Other fixes than those that it was found by are believed.
    place_.reset();
    withdrawn_map_ = map;
  }
}

void LoopCorrector::report_fixes() {
  const GnssTrack& gnss = closer_->gnss();
  count_new("gnss_fixes", gnss.placed(), reported_placed_);
  count_new("gnss_fixes_between_no_scans", gnss.misplaced(), reported_misplaced_);
  count_new("gnss_positions_doubted", closer_->position_counts().in_doubt, reported_doubted_);
  const double delay_s = gnss.delay().delay_s;
  if (std::exchange(reported_delay_s_, delay_s) != delay_s) {
    spdlog::warn(
        "GNSS: the stamps of the fixes are taken to be {:.3f} s late, since they fit the way so "
        "(gnss.time_offset_s)",
        delay_s);
  }
  const bool are_refused = closer_->are_positions_refused();
  if (std::exchange(were_refused_, are_refused) == are_refused) return;
  const char* const why =
      "GNSS: the fixes are not used, since most of them contradict what odometry says of the way: "
      "stamps by another clock (gnss.time_offset_s), or a receiver that is not on this robot?";
  if (are_refused) spdlog::warn(why);
  statistics_.set_input_fault("gnss", are_refused ? why : "");
}

void LoopCorrector::count_new(const char* counter, std::size_t now, std::size_t& reported) {
  if (now > reported) statistics_.count(counter, now - reported);
  reported = std::max(reported, now);
}

void LoopCorrector::report_closures() {
  count_new("submaps_in_earlier_map", closer_->anchors(), reported_anchors_);
  const auto& closures = closer_->closures();
  for (std::size_t i = reported_; i < closures.size(); ++i) {
    statistics_.count("loops_closed");
    spdlog::info("a place was seen again: overlap {:.2f}, fit {:.2f}, {:.2f} m from where it was",
                 closures[i].overlap, closures[i].fit, closures[i].jump_m);
  }
  // One that was denied again is missing in the middle; it was counted.
  reported_ = std::max(reported_, closures.size());
}

}  // namespace stillmap::server
