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

}  // namespace

LoopCorrector::LoopCorrector(const LiveLoopConfig& config, bool is_lossless, Statistics& statistics)
    : config_(config),
      is_lossless_(is_lossless),
      statistics_(statistics),
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
}

void LoopCorrector::add(std::shared_ptr<const LabelledScan> labelled,
                        const Eigen::Isometry3d& T_odom_lidar, bool is_confirmed) {
  if (map_ == 0) return;
  ScanOfMap scan{map_, std::move(labelled), T_odom_lidar, is_confirmed};
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
    reported_ = 0;
  }
  const auto began = std::chrono::steady_clock::now();
  const bool had_ended = !closer_->end_reason().empty();
  auto correction = closer_->add(*scan.labelled, scan.T_odom_lidar, scan.is_confirmed);
  statistics_.add_latency("loops", milliseconds(std::chrono::steady_clock::now() - began));
  if (!had_ended && !closer_->end_reason().empty())
    spdlog::warn("loops stay open from here on: {}", closer_->end_reason());
  const auto& closures = closer_->closures();
  for (std::size_t i = reported_; i < closures.size(); ++i) {
    statistics_.count("loops_closed");
    spdlog::info("a place was seen again: overlap {:.2f}, fit {:.2f}, {:.2f} m from where it was",
                 closures[i].overlap, closures[i].fit, closures[i].jump_m);
  }
  // One that was denied again is missing in the middle; it was counted.
  reported_ = std::max(reported_, closures.size());
  if (!correction) return;
  // Of two that were not taken yet the second is of the map after the first.
  const std::scoped_lock lock(mutex_);
  if (found_ && found_->map == scan.map)
    found_->correction = combined(found_->correction, *correction);
  else
    found_ = Found{scan.map, *std::move(correction)};
}

}  // namespace stillmap::server
