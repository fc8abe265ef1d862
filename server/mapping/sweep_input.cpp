#include "server/mapping/sweep_input.hpp"

#include <algorithm>
#include <utility>

#include "core/lidar/prepare.hpp"

namespace stillmap::server {
namespace {

// With delivery `every`, a lidar may be so far ahead of another one,
constexpr std::size_t max_ahead = 3;
// and a sweep waits at least so long for a scan: no time of the sensor's passes between scans.
constexpr double min_lossless_wait_s = 5.0;

SweepMerger::Config merging_of(const ServerConfig& config) {
  const double wait_s = config.input.sweep_wait_s;
  const bool every = config.input.delivery == DeliveryMode::every;
  return {.lidars = config.lidars.size(),
          .period_s = config.mapper.sensor.period_s,
          .max_wait_s = every ? std::max(wait_s, min_lossless_wait_s) : wait_s};
}

// What is too near or too far for the lidar itself.
PrepareConfig range_of(const PrepareConfig& prepare) {
  return {.min_range_m = prepare.min_range_m,
          .max_range_m = prepare.max_range_m,
          .ego_hull_lidar = {},
          .deskew = false};
}

std::vector<Eigen::Isometry3d> places_of(const ServerConfig& config) {
  const Eigen::Isometry3d T_merged_base = config.mount.T_base_lidar.inverse();
  std::vector<Eigen::Isometry3d> places;
  places.reserve(config.lidars.size());
  for (const LidarConfig& lidar : config.lidars) {
    places.emplace_back(T_merged_base * lidar.T_base_lidar);
  }
  return places;
}

}  // namespace

SweepInput::SweepInput(const ServerConfig& config, ScanQueue& queue, Statistics& statistics)
    : lidars_(config.lidars),
      usable_(range_of(config.mapper.prepare)),
      T_merged_lidars_(places_of(config)),
      frame_(config.frames.lidar),
      delivery_(config.input.delivery),
      queue_(queue),
      statistics_(statistics),
      merger_(merging_of(config)) {}

double SweepInput::now_s() const {
  return std::chrono::duration<double>(Clock::now() - began_).count();
}

void SweepInput::add(std::size_t lidar, Scan scan, const std::stop_token& stop) {
  scan = drop_unusable_points(std::move(scan), usable_);
  move_points(scan, T_merged_lidars_[lidar]);
  std::unique_lock lock(mutex_);
  const std::size_t lost = merger_.add(lidar, std::move(scan), now_s());
  if (lost > 0) {
    drop("out_of_sweep", lost,
         "scans of lidar '" + lidars_[lidar].name +
             "' come after their sweep, or their clock differs from that of the others");
  }
  queue_sweeps(stop);
  sweeps_changed_.notify_all();
  while (delivery_ == DeliveryMode::every && merger_.waiting(lidar) > max_ahead &&
         !stop.stop_requested()) {
    sweeps_changed_.wait_for(lock, stop, std::chrono::milliseconds(100),
                             [&] { return merger_.waiting(lidar) <= max_ahead; });
    queue_sweeps(stop);
  }
}

void SweepInput::queue_overdue(const std::stop_token& stop) {
  const std::scoped_lock lock(mutex_);
  queue_sweeps(stop);
}

void SweepInput::queue_sweeps(const std::stop_token& stop) {
  while (auto sweep = merger_.next(now_s())) queue(*std::move(sweep), stop);
}

void SweepInput::queue(SweepMerger::Sweep sweep, const std::stop_token& stop) {
  for (const std::size_t lidar : sweep.missing) {
    const std::string& name = lidars_[lidar].name;
    statistics_.sweep_without(name);
    throttled_log_.warn("lidar_" + name, "no scan of lidar '" + name + "' on " +
                                             lidars_[lidar].topic +
                                             " in time: the sweep goes on without it");
  }
  statistics_.scan_received();
  QueuedScan queued{std::move(sweep.scan), frame_, Clock::now()};
  if (delivery_ == DeliveryMode::every) {
    if (!queue_.push_blocking(std::move(queued), stop)) {
      drop("shutdown", 1, "the server is stopping");
    }
    return;
  }
  const std::size_t dropped = queue_.push_dropping_oldest(std::move(queued));
  if (dropped > 0) drop("queue_full", dropped, "scans arrive faster than they can be mapped");
}

void SweepInput::drop(const std::string& reason, std::size_t count, const std::string& detail) {
  statistics_.scans_dropped(reason, count, detail);
  throttled_log_.warn(reason, "scan dropped: " + detail);
}

}  // namespace stillmap::server
