#include "server/occupancy/occupancy_thread.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

namespace stillmap::server {
namespace {

/// Besides scans: a new map, a view to follow, an encoding.
constexpr std::size_t urgent_kinds = 3;

/// Of jobs in the queue's order.
template <typename Jobs>
std::size_t scans_in(Jobs& jobs) {
  const auto oldest = std::ranges::find_if(
      jobs, [](const auto& job) { return std::holds_alternative<OccupancyScan>(job); });
  return static_cast<std::size_t>(jobs.end() - oldest);
}

}  // namespace

OccupancyThread::OccupancyThread(const OccupancyServiceConfig& config, Statistics& statistics,
                                 ThrottleCallback throttle, BackgroundScheduling scheduling,
                                 DeliveryMode delivery)
    : config_(config.map),
      max_scans_(config.queue_length),
      every_scan_counts_(delivery == DeliveryMode::every),
      statistics_(statistics),
      throttle_(std::move(throttle)),
      jobs_(config.queue_length + urgent_kinds),
      map_(config.map),
      worker_("octree", jobs_,
              [this](Job job) { std::visit([this](auto& kind) { run(std::move(kind)); }, job); },
              {.on_start = [scheduling] { static_cast<void>(use_scheduling(scheduling)); },
               .before_take = [this] { this->throttle(); }}) {}

void OccupancyThread::insert_urgent(Jobs& jobs, Job job) {
  const auto position = std::ranges::find_if(
      jobs, [&](const Job& waiting) { return waiting.index() >= job.index(); });
  if (position != jobs.end() && position->index() == job.index()) {
    *position = std::move(job);
  } else {
    jobs.insert(position, std::move(job));
  }
}

void OccupancyThread::begin(std::shared_ptr<const MapSnapshot> view) {
  jobs_.edit([&](Jobs& jobs) {
    std::erase_if(jobs, [](const Job& job) { return !std::holds_alternative<Encoding>(job); });
    {
      const std::scoped_lock lock(next_map_mutex_);
      next_map_ = view->tiles.empty() ? NextMap::empty : NextMap::of_voxels;
      refused_from_ = std::chrono::steady_clock::now() + longest_wait;
    }
    insert_urgent(jobs, NewMap{std::move(view)});
    ++maps_begun_;
  });
  made_.notify_all();
}

void OccupancyThread::add(OccupancyScan scan) {
  if (every_scan_counts_) {
    jobs_.wait_until(
        [this](const Jobs& jobs) { return is_released_ || scans_in(jobs) < max_scans_; },
        longest_back_pressure);
  }
  jobs_.edit([&](Jobs& jobs) {
    if (const std::size_t scans = scans_in(jobs); scans >= max_scans_) {
      jobs.erase(jobs.end() - static_cast<std::ptrdiff_t>(scans));
      statistics_.count("occupancy_scans_dropped");
    }
    jobs.emplace_back(std::move(scan));
  });
}

void OccupancyThread::release() {
  jobs_.edit([this](Jobs&) { is_released_ = true; });
}

void OccupancyThread::follow(std::shared_ptr<const MapSnapshot> view) {
  jobs_.edit([&](Jobs& jobs) {
    if (view == std::exchange(followed_, view)) return;
    insert_urgent(jobs, Residency{std::move(view)});
  });
}

void OccupancyThread::run(Residency job) {
  const auto lock = lock_to_change();
  if (map_.sync_residency(*job.view)) ++changes_;
}

void OccupancyThread::run(NewMap job) {
  OccupancyMap fresh(config_);
  if (const std::size_t left_out = fresh.insert(*job.view, throttle_); left_out > 0) {
    spdlog::warn(
        "{} voxels of the map lie farther than {:.0f} m from its origin, where the octree ends: "
        "they are unknown to occupancy queries; occupancy.resolution_m makes it reach farther",
        left_out, fresh.reach_m());
  }
  fresh.begin_residency(*job.view);
  {
    const auto lock = lock_to_change();
    map_ = std::move(fresh);
    ++maps_made_;
    stamp_ns_ = 0;
    jobs_.edit([&](const Jobs& jobs) {
      const bool another_waits = !jobs.empty() && std::holds_alternative<NewMap>(jobs.front());
      if (another_waits) return;
      const std::scoped_lock lock_next(next_map_mutex_);
      next_map_ = NextMap::none;
    });
    ++changes_;
  }
  made_.notify_all();
}

void OccupancyThread::run(Encoding job) {
  // Only this thread changes the map: queries may go on meanwhile.
  job.encoded.set_value({map_.encode(OctomapEncoding::binary), stamp_ns_});
}

void OccupancyThread::run(OccupancyScan scan) {
  using Clock = std::chrono::steady_clock;
  const auto began = Clock::now();
  const bool clears = every_scan_counts_ || jobs_.waiting() <= max_scans_ / 2;
  if (!clears) statistics_.count("occupancy_not_cleared");
  // Only this thread changes the map; a query waits for one portion, and this for one of a query's.
  map_.compute_update(*scan.labelled, scan.T_map_lidar,
                      {.clear_free_space = clears, .unknown_is_solid = scan.unknown_is_solid},
                      throttle_);
  while (apply_portion()) throttle();
  {
    const auto lock = lock_to_change();
    stamp_ns_ = scan.labelled->scan.stamp_ns;
    ++changes_;
  }
  const std::chrono::duration<double, std::milli> took = Clock::now() - began;
  statistics_.add_latency("occupancy", took.count());
}

bool OccupancyThread::apply_portion() {
  const auto lock = lock_to_change();
  return map_.apply_update(OccupancyMap::portion_bricks);
}

void OccupancyThread::throttle() const {
  if (throttle_) throttle_();
}

std::unique_lock<std::mutex> OccupancyThread::lock_made() const {
  std::unique_lock next_map(next_map_mutex_);
  // A copy: another map may begin meanwhile.
  const auto refused_from = refused_from_;
  if (!made_.wait_until(next_map, refused_from,
                        [this] { return next_map_ != NextMap::of_voxels; })) {
    throw OctreeNotMade(
        "the octree of the map that has just begun is still being made, at idle priority: ask "
        "again");
  }
  next_map.unlock();
  return std::unique_lock(map_mutex_);
}

std::unique_lock<std::mutex> OccupancyThread::lock_to_change() {
  wants_to_change_ = true;
  std::unique_lock lock(map_mutex_);
  wants_to_change_ = false;
  return lock;
}

template <typename Read>
auto OccupancyThread::of_one_map(Read read) const {
  // For the octree's thread to wake up and take the lock. It may have idle priority: where it does
  // not come, nobody waits for it.
  constexpr std::chrono::microseconds handover(200);
  struct AnotherMap {};
  while (true) {
    auto lock = lock_made();
    if (next_map_ == NextMap::empty) return read(OccupancyMap(config_), 0, ThrottleCallback());
    const std::uint64_t map = maps_made_;
    auto since = std::chrono::steady_clock::now();
    const auto pause = [&] {
      if (std::chrono::steady_clock::now() - since < reading_portion) return;
      if (wants_to_change_) {
        lock.unlock();
        std::this_thread::sleep_for(handover);
        lock.lock();
        if (maps_made_ != map || next_map_ != NextMap::none) throw AnotherMap();
      }
      since = std::chrono::steady_clock::now();
    };
    try {
      return read(map_, stamp_ns_, ThrottleCallback(pause));
    } catch (const AnotherMap&) {
      // From the beginning, with the one that is there now.
    }
  }
}

OccupancyAnswers OccupancyThread::answer(const OccupancyQuery& query) const {
  return of_one_map([&](const OccupancyMap& map, std::int64_t, const ThrottleCallback& pause) {
    return map.answer(query, pause);
  });
}

EncodedOctree OccupancyThread::encode(OctomapEncoding encoding) const {
  return of_one_map(
      [&](const OccupancyMap& map, std::int64_t stamp_ns, const ThrottleCallback& pause) {
        return EncodedOctree{map.encode(encoding, pause), stamp_ns};
      });
}

std::future<EncodedOctree> OccupancyThread::encode_in_background() {
  Encoding job;
  std::future<EncodedOctree> encoded = job.encoded.get_future();
  jobs_.edit([&](Jobs& jobs) { insert_urgent(jobs, std::move(job)); });
  return encoded;
}

}  // namespace stillmap::server
