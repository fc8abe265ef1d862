#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "config/loaders/server_config.hpp"
#include "core/occupancy/occupancy_map.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// A mapped scan on its way into the octree, shared with whoever else uses it.
struct OccupancyScan {
  std::shared_ptr<const LabelledScan> labelled;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Points of no known class are solid.
  bool unknown_is_solid = true;
};

/// The octree as it was when asked for.
struct EncodedOctree {
  OctomapData data;
  /// Stamp of the newest scan that is in it as a whole; 0: none.
  std::int64_t stamp_ns = 0;
};

/// Keeps the octree on a thread of its own and of low priority, so that the mapper never waits for
/// it. Who cannot keep up leaves out clearing first ("occupancy_not_cleared" in the status), then
/// scans
/// ("occupancy_scans_left_out"). Thread-safe.
class OccupancyThread {
 public:
  OccupancyThread(const OccupancyServiceConfig& config, Statistics& statistics,
                  ThrottleCallback throttle = {});

  /// A new map begins, with the voxels of this view; until they are there, answers are those of an
  /// empty one. Returns at once, as `add` does.
  void begin(std::shared_ptr<const MapSnapshot> view);
  void add(OccupancyScan scan);
  /// Tiles left memory, or came back.
  void follow(std::shared_ptr<const MapSnapshot> view);

  /// Throws std::invalid_argument for a query that asks for too much.
  [[nodiscard]] OccupancyAnswers answer(const OccupancyQuery& query) const;
  /// At once, on the calling thread.
  [[nodiscard]] EncodedOctree encode(bool binary) const;
  /// On this object's thread, when that comes to it; one at a time. The future throws
  /// std::future_error where the thread ends before.
  [[nodiscard]] std::future<EncodedOctree> encode_in_background();
  /// Grows with every change, over all maps.
  [[nodiscard]] std::uint64_t changes() const;

 private:
  /// Either a new map or a scan, or the newest view to be followed, or an octree to be encoded.
  struct Job {
    std::shared_ptr<const MapSnapshot> first_view;
    std::shared_ptr<const MapSnapshot> next_view;
    OccupancyScan scan;
    std::optional<std::promise<EncodedOctree>> encoded;
  };

  void work(const std::stop_token& stop);
  void work_on(Job job, bool keeps_up);
  /// Under the queue's lock.
  [[nodiscard]] bool has_work() const { return !queue_.empty() || to_follow_ || to_encode_; }
  [[nodiscard]] Job next_job();
  void begin_map(const MapSnapshot& view);
  void follow_now(const MapSnapshot& view);
  void insert(const OccupancyScan& scan, bool clears);
  /// Of what was gathered; true while more is left.
  bool insert_portion();
  void throttle() const;

  OccupancyConfig config_;
  std::size_t capacity_;
  Statistics& statistics_;
  ThrottleCallback throttle_;
  mutable std::mutex queue_mutex_;
  std::condition_variable_any queue_changed_;
  std::deque<Job> queue_;
  std::shared_ptr<const MapSnapshot> to_follow_;
  std::optional<std::promise<EncodedOctree>> to_encode_;
  /// The last view that was to be followed.
  std::shared_ptr<const MapSnapshot> followed_;
  mutable std::mutex map_mutex_;
  OccupancyMap map_;
  /// The one before that which is to begin.
  std::atomic<bool> has_old_map_ = false;
  std::uint64_t changes_ = 0;
  std::int64_t stamp_ns_ = 0;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
