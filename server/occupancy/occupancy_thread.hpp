#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <variant>

#include "config/loaders/server_config.hpp"
#include "core/occupancy/occupancy_map.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// A mapped scan on its way into the octree, shared with the other consumers of the scan.
struct OccupancyScan {
  std::shared_ptr<const LabelledScan> labelled;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Points of no known class are solid.
  bool unknown_is_solid = true;
};

/// An octree in OctoMap's encoding.
struct EncodedOctree {
  OctomapData data;
  /// Stamp of the newest scan that is in it as a whole; 0: none.
  std::int64_t stamp_ns = 0;
};

/// The octree of a map that has just begun is not there yet.
class OctreeNotMade : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Keeps the octree on a thread, of idle priority so that the mapper never waits for it. When it
/// cannot keep up, it first stops clearing free space along the rays ("occupancy_not_cleared" in
/// the status), then drops scans ("occupancy_scans_dropped"). Where every scan counts, it runs at
/// normal priority, and the mapper waits for it instead. Thread-safe.
class OccupancyThread {
 public:
  OccupancyThread(const OccupancyServiceConfig& config, Statistics& statistics,
                  ThrottleCallback throttle = {},
                  BackgroundScheduling scheduling = BackgroundScheduling::idle,
                  DeliveryMode delivery = DeliveryMode::latest);

  /// How long after the beginning of a map queries still wait for its octree: less than clients
  /// wait for an answer before they ask again. They are answered one after the other: were it as
  /// long for each, those behind the first would hear nothing in time.
  static constexpr std::chrono::milliseconds longest_wait{2000};

  /// With delivery `every`, how long `add` waits for room at most: an octree that makes none by
  /// then must not end a replay.
  static constexpr std::chrono::milliseconds longest_back_pressure{20'000};

  /// Starts a new map from the voxels of this view; until they are inserted, queries wait. Returns
  /// at once, as `add` does but with delivery `every`; one thread calls both.
  void begin(std::shared_ptr<const MapSnapshot> view);
  void add(OccupancyScan scan);
  /// The server ends: from now on `add` does not wait for room.
  void release();
  /// Drops and restores parts of the octree with the tiles that were evicted and reloaded.
  void follow(std::shared_ptr<const MapSnapshot> view);

  /// About the longest time for which an answer keeps the octree from being changed.
  static constexpr std::chrono::milliseconds reading_portion{1};

  /// Throws std::invalid_argument for a query that asks for too much, OctreeNotMade where
  /// the octree is not there `longest_wait` after `begin`. The octree goes on changing meanwhile;
  /// all of an answer is of one map.
  [[nodiscard]] OccupancyAnswers answer(const OccupancyQuery& query) const;
  /// Encodes on the calling thread; the stamp is of the call's beginning. As `answer`.
  [[nodiscard]] EncodedOctree encode(OctomapEncoding encoding) const;
  /// Encodes on this object's thread, before the scans that wait; one request at a time. The future
  /// throws std::future_error when the thread ends before.
  [[nodiscard]] std::future<EncodedOctree> encode_in_background();
  /// Grows with every change, over all maps.
  [[nodiscard]] std::uint64_t changes() const { return changes_; }
  /// Grows with every `begin`.
  [[nodiscard]] std::uint64_t maps_begun() const { return maps_begun_; }

 private:
  struct NewMap {
    std::shared_ptr<const MapSnapshot> view;
  };
  struct Residency {
    std::shared_ptr<const MapSnapshot> view;
  };
  struct Encoding {
    std::promise<EncodedOctree> encoded;
  };
  /// The queue keeps them in this order: at most one of each of the first three, then scans.
  using Job = std::variant<NewMap, Residency, Encoding, OccupancyScan>;
  using Jobs = std::deque<Job>;

  /// Puts the job before those of later kinds; replaces one of the same kind.
  static void insert_urgent(Jobs& jobs, Job job);

  void run(NewMap job);
  void run(Residency job);
  void run(Encoding job);
  void run(OccupancyScan scan);
  /// Part of the update that was computed; true while more is left.
  bool apply_portion();
  void throttle() const;
  /// Waits while the octree is of a map that is no more, and the new one's is still being made.
  [[nodiscard]] std::unique_lock<std::mutex> lock_made() const;
  /// The map's lock, for who changes it: who reads it lets go of it soon.
  [[nodiscard]] std::unique_lock<std::mutex> lock_to_change();
  /// What `read` makes of the octree, or of an empty one where that is the map's. `read` gets the
  /// map, the stamp of its newest scan, and a pause, in which the octree may change; it starts over
  /// where another map begins in one.
  template <typename Read>
  [[nodiscard]] auto of_one_map(Read read) const;

  OccupancyConfig config_;
  std::size_t max_scans_;
  bool every_scan_counts_;
  Statistics& statistics_;
  ThrottleCallback throttle_;
  BoundedQueue<Job> jobs_;
  /// The last view that was given to `follow`. Guarded by the queue's lock.
  std::shared_ptr<const MapSnapshot> followed_;
  /// Guarded by the queue's lock.
  bool is_released_ = false;
  mutable std::mutex map_mutex_;
  OccupancyMap map_;
  /// Maps that `map_` has been; guarded by the map's lock.
  std::uint64_t maps_made_ = 0;
  /// Whether this object's thread waits for the map's lock.
  std::atomic<bool> wants_to_change_ = false;
  /// What waits to replace it: a map without voxels needs no octree to answer from.
  enum class NextMap : std::uint8_t { none, empty, of_voxels };
  /// Changed under the queue's lock and the next one.
  std::atomic<NextMap> next_map_ = NextMap::none;
  /// The last one taken: a map begins without waiting for queries, which hold the map's.
  mutable std::mutex next_map_mutex_;
  mutable std::condition_variable made_;
  /// When queries wait no longer for the map that has begun.
  std::chrono::steady_clock::time_point refused_from_;
  std::atomic<std::uint64_t> maps_begun_ = 0;
  std::atomic<std::uint64_t> changes_ = 0;
  std::int64_t stamp_ns_ = 0;
  // Last: stops before what it uses is gone.
  Worker<Job> worker_;
};

}  // namespace stillmap::server
