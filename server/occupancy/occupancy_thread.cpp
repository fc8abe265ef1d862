#include "server/occupancy/occupancy_thread.hpp"

#include <chrono>
#include <utility>

#include "server/monitoring/idle_scheduling.hpp"

namespace stillmap::server {

OccupancyThread::OccupancyThread(const OccupancyServiceConfig& config, Statistics& statistics,
                                 ThrottleCallback throttle)
    : config_(config.map),
      capacity_(config.queue_length),
      statistics_(statistics),
      throttle_(std::move(throttle)),
      map_(config.map),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

void OccupancyThread::begin(std::shared_ptr<const MapSnapshot> view) {
  const std::scoped_lock lock(queue_mutex_);
  queue_.clear();
  to_follow_ = nullptr;
  queue_.push_back({std::move(view), nullptr, {}, {}});
  has_old_map_ = true;
  queue_changed_.notify_one();
}

void OccupancyThread::add(OccupancyScan scan) {
  const std::scoped_lock lock(queue_mutex_);
  if (queue_.size() >= capacity_) {
    // A map that begins stays at the front.
    const auto oldest = queue_.begin() + (queue_.front().first_view ? 1 : 0);
    if (oldest != queue_.end()) queue_.erase(oldest);
    statistics_.count("occupancy_scans_left_out");
  }
  queue_.push_back({nullptr, nullptr, std::move(scan), {}});
  queue_changed_.notify_one();
}

void OccupancyThread::follow(std::shared_ptr<const MapSnapshot> view) {
  const std::scoped_lock lock(queue_mutex_);
  if (view == followed_) return;
  followed_ = view;
  to_follow_ = std::move(view);
  queue_changed_.notify_one();
}

void OccupancyThread::work(const std::stop_token& stop) {
  static_cast<void>(use_idle_scheduling());
  while (true) {
    std::unique_lock lock(queue_mutex_);
    if (!queue_changed_.wait(lock, stop, [this] { return has_work(); })) return;
    lock.unlock();
    // First, so that the job is what there is to do then.
    throttle();
    lock.lock();
    if (stop.stop_requested()) return;
    Job job = next_job();
    const bool keeps_up = queue_.size() <= capacity_ / 2;
    lock.unlock();
    work_on(std::move(job), keeps_up);
  }
}

void OccupancyThread::work_on(Job job, bool keeps_up) {
  if (job.first_view) {
    begin_map(*job.first_view);
  } else if (job.next_view) {
    follow_now(*job.next_view);
  } else if (job.encoded) {
    // Only this thread changes the map: who asks need not wait.
    job.encoded->set_value({map_.encode(true), stamp_ns_});
  } else {
    insert(job.scan, keeps_up);
  }
}

OccupancyThread::Job OccupancyThread::next_job() {
  const bool begins = !queue_.empty() && queue_.front().first_view;
  if (to_follow_ && !begins) return {nullptr, std::exchange(to_follow_, nullptr), {}, {}};
  if (to_encode_ && !begins) {
    return {nullptr, nullptr, {}, std::exchange(to_encode_, std::nullopt)};
  }
  Job job = std::move(queue_.front());
  queue_.pop_front();
  return job;
}

void OccupancyThread::follow_now(const MapSnapshot& view) {
  const std::scoped_lock lock(map_mutex_);
  if (map_.sync_residency(view)) ++changes_;
}

void OccupancyThread::begin_map(const MapSnapshot& view) {
  OccupancyMap fresh(config_);
  fresh.insert(view, throttle_);
  fresh.sync_residency(view);
  const std::scoped_lock lock(map_mutex_, queue_mutex_);
  map_ = std::move(fresh);
  stamp_ns_ = 0;
  // Unless yet another one is to begin.
  has_old_map_ = !queue_.empty() && queue_.front().first_view;
  ++changes_;
}

void OccupancyThread::insert(const OccupancyScan& scan, bool clears) {
  using Clock = std::chrono::steady_clock;
  const auto began = Clock::now();
  if (!clears) statistics_.count("occupancy_not_cleared");
  // Only this thread changes the map; who asks waits for a portion at most.
  map_.compute_update(*scan.labelled, scan.T_map_lidar,
                      {.clear_free_space = clears, .unknown_is_solid = scan.unknown_is_solid},
                      throttle_);
  while (insert_portion()) throttle();
  {
    const std::scoped_lock lock(map_mutex_);
    stamp_ns_ = scan.labelled->scan.stamp_ns;
    ++changes_;
  }
  const std::chrono::duration<double, std::milli> took = Clock::now() - began;
  statistics_.add_latency("occupancy", took.count());
}

bool OccupancyThread::insert_portion() {
  const std::scoped_lock lock(map_mutex_);
  return map_.apply_update(OccupancyMap::portion_bricks);
}

void OccupancyThread::throttle() const {
  if (throttle_) throttle_();
}

OccupancyAnswers OccupancyThread::answer(const OccupancyQuery& query) const {
  if (has_old_map_) return OccupancyMap(config_).answer(query);
  const std::scoped_lock lock(map_mutex_);
  return map_.answer(query);
}

EncodedOctree OccupancyThread::encode(bool binary) const {
  if (has_old_map_) return {OccupancyMap(config_).encode(binary), 0};
  const std::scoped_lock lock(map_mutex_);
  return {map_.encode(binary), stamp_ns_};
}

std::future<EncodedOctree> OccupancyThread::encode_in_background() {
  const std::scoped_lock lock(queue_mutex_);
  std::future<EncodedOctree> encoded = to_encode_.emplace().get_future();
  queue_changed_.notify_one();
  return encoded;
}

std::uint64_t OccupancyThread::changes() const {
  const std::scoped_lock lock(map_mutex_);
  return changes_;
}

}  // namespace stillmap::server
