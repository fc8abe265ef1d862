#include "server/mapping/loop_corrector.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "server/mapping/milliseconds.hpp"
#include "server/threads/background_throttle.hpp"

namespace stillmap::server {
namespace {

/// A search takes a second or two, in which a lidar sends so many scans.
constexpr std::size_t max_waiting_scans = 20;
/// A minute at 10 Hz.
constexpr std::size_t max_waiting_fixes = 600;

}  // namespace

LoopCorrector::LoopCorrector(const LiveLoopConfig& config, bool is_lossless, Statistics& statistics,
                             const Eigen::Vector3d& antenna_base)
    : config_(config),
      is_lossless_(is_lossless),
      statistics_(statistics),
      antenna_base_(antenna_base),
      scans_(max_waiting_scans) {
  worker_.emplace(
      scans_, [this](const ScanOfMap& scan) { look_at(scan); }, WorkerOptions{.on_start = [] {
        static_cast<void>(use_scheduling(BackgroundScheduling::low));
      }});
}

void LoopCorrector::begin_map(bool is_new) {
  map_ = is_new ? ++maps_ : 0;
  const std::scoped_lock lock(mutex_);
  found_.reset();
  place_.reset();
}

void LoopCorrector::add(const GnssFix& fix) {
  const std::scoped_lock lock(mutex_);
  // Nobody looks at scans: there are none, or the map was loaded.
  if (fixes_.size() >= max_waiting_fixes) {
    fixes_.erase(fixes_.begin());
    statistics_.count("gnss_fixes_unused");
  }
  fixes_.push_back(fix);
}

void LoopCorrector::add(std::shared_ptr<const LabelledScan> labelled,
                        const Eigen::Isometry3d& T_odom_lidar,
                        const Eigen::Isometry3d& T_base_lidar, bool is_confirmed) {
  if (map_ == 0) return;
  ScanOfMap scan{map_, std::move(labelled), T_odom_lidar, T_base_lidar.inverse() * antenna_base_,
                 is_confirmed};
  if (is_lossless_) {
    // The worker outlives mapping: there is nothing to stop for.
    static_cast<void>(scans_.push_blocking(std::move(scan), {}));
    return;
  }
  const std::size_t left_out = scans_.push_dropping_oldest(std::move(scan));
  if (left_out > 0) statistics_.count("scans_not_in_loops", left_out);
}

std::optional<MapCorrection> LoopCorrector::take() {
  const std::scoped_lock lock(mutex_);
  auto found = std::exchange(found_, std::nullopt);
  if (!found || found->map != map_) return std::nullopt;
  return std::move(found->correction);
}

std::optional<MapOnEarth> LoopCorrector::take_place() {
  const std::scoped_lock lock(mutex_);
  const auto place = std::exchange(place_, std::nullopt);
  if (!place || place->map != map_) return std::nullopt;
  return place->place;
}

void LoopCorrector::report(const MapCorrection& correction, const CorrectedMap& corrected,
                           double ms) {
  statistics_.count("map_corrections");
  statistics_.add_latency("correction", ms);
  spdlog::info(
      "map corrected in {:.0f} ms: {} voxels moved, {} tiles changed; the robot by {:.2f} m", ms,
      corrected.moved_voxels, corrected.changed_tiles,
      MapCorrection::max_shift_m(correction.poses().back(), 0.0));
}

void LoopCorrector::look_at(const ScanOfMap& scan) {
  if (std::exchange(closed_map_, scan.map) != scan.map) {
    closer_.emplace(config_);
    reported_ = reported_placed_ = reported_misplaced_ = 0;
  }
  const auto began = std::chrono::steady_clock::now();
  const bool had_ended = !closer_->end_reason().empty();
  hand_on_fixes();
  auto correction =
      closer_->add(*scan.labelled, scan.T_odom_lidar, scan.is_confirmed, scan.antenna_lidar);
  statistics_.add_latency("loops", milliseconds(std::chrono::steady_clock::now() - began));
  if (!had_ended && !closer_->end_reason().empty())
    spdlog::warn("loops stay open from here on: {}", closer_->end_reason());
  report_fixes();
  report_closures();
  const std::scoped_lock lock(mutex_);
  if (const auto place = closer_->on_earth()) place_ = Place{scan.map, *place};
  if (!correction) return;
  // Of two that were not taken yet the second is of the map after the first.
  if (found_ && found_->map == scan.map)
    found_->correction = combined(found_->correction, *correction);
  else
    found_ = Found{scan.map, *std::move(correction)};
}

void LoopCorrector::hand_on_fixes() {
  std::vector<GnssFix> fixes;
  {
    const std::scoped_lock lock(mutex_);
    fixes.swap(fixes_);
  }
  for (const GnssFix& fix : fixes) {
    const std::string refusal = closer_->add(fix);
    if (refusal.empty()) continue;
    statistics_.count("gnss_fixes_refused");
    throttled_log_.warn("gnss", "a GNSS fix is not used: " + refusal);
  }
}

void LoopCorrector::report_fixes() {
  const GnssTrack& gnss = closer_->gnss();
  const auto count_new = [this](const char* counter, std::size_t now, std::size_t& reported) {
    if (now > reported) statistics_.count(counter, now - reported);
    reported = now;
  };
  count_new("gnss_fixes", gnss.placed(), reported_placed_);
  count_new("gnss_fixes_between_no_scans", gnss.misplaced(), reported_misplaced_);
}

void LoopCorrector::report_closures() {
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
