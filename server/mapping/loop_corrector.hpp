#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <vector>

#include "core/graph/live_loop_closer.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/submap_list.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/bounded_queue.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// Finds places that the robot comes back to, on a thread of its own, for the mapping thread to
/// correct the map by. All functions are the mapping thread's.
class LoopCorrector {
 public:
  /// The statistics must outlive it. `is_lossless`: mapping waits where the search does not keep
  /// up; else the oldest scan that waits for it gives way.
  /// `antenna_base`: of the receiver whose fixes it gets, on the robot [m].
  LoopCorrector(const LiveLoopConfig& config, bool is_lossless, Statistics& statistics,
                const Eigen::Vector3d& antenna_base = {0, 0, 0});

  /// A fix of the receiver. Thread-safe, unlike the others. Counted are those that are used
  /// ("gnss_fixes"), refused ("gnss_fixes_refused"), not between two scans of a moving robot
  /// ("gnss_fixes_between_no_scans"), and never looked at ("gnss_fixes_unused").
  void add(const GnssFix& fix);

  /// Another map began. In one that was loaded no loops are closed: poses of earlier runs are not
  /// known scan by scan.
  void begin_map(bool is_new);
  /// The robot was set elsewhere: what odometry says of the way until there is not true.
  void end_map() { begin_map(false); }
  /// A scan of the map.
  void add(std::shared_ptr<const LabelledScan> labelled, const Eigen::Isometry3d& T_odom_lidar,
           const Eigen::Isometry3d& T_base_lidar, bool is_confirmed);
  /// Scans that are not looked at yet.
  [[nodiscard]] std::size_t waiting() const { return scans_.waiting(); }
  /// What is to be moved, once; it has to be. Nothing after a clock that was set back: what was
  /// seen since then would be taken for what was seen before.
  [[nodiscard]] std::optional<MapCorrection> take();
  /// Where the map lies, when that was found out or found out better; once, and only as the map is:
  /// not between a correction and its report.
  [[nodiscard]] std::optional<MapOnEarth> take_place();
  /// The submaps, by poses of the lidar, where there is another one or they were moved; once, and
  /// only as the map has them: not between a correction and its report.
  [[nodiscard]] std::optional<SubmapList> take_submaps();
  /// It was moved, within this time.
  void report(const MapCorrection& correction, const CorrectedMap& corrected, double ms);

 private:
  struct ScanOfMap {
    std::uint64_t map = 0;
    /// Null: another map begins.
    std::shared_ptr<const LabelledScan> labelled;
    Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
    Eigen::Vector3d antenna_lidar = Eigen::Vector3d::Zero();
    bool is_confirmed = false;
  };

  // Of the worker.
  void look_at(const ScanOfMap& scan);
  void hand_on_fixes();
  void report_fixes();
  void report_closures();
  void hand_on_submaps(std::uint64_t map);

  LiveLoopConfig config_;
  bool is_lossless_;
  Statistics& statistics_;
  Eigen::Vector3d antenna_base_;
  /// Maps are numbered; 0: loops stay open.
  std::uint64_t map_ = 0;
  std::uint64_t maps_ = 0;
  /// Of the map's scans: corrections tell them apart by their stamps.
  std::int64_t last_stamp_ns_ = std::numeric_limits<std::int64_t>::min();
  bool is_clock_set_back_ = false;
  /// Of the graph, as the correction that was taken last makes the map, and as the map is.
  std::uint64_t taken_revision_ = 0;
  std::uint64_t map_revision_ = 0;

  std::mutex mutex_;
  struct Found {
    std::uint64_t map = 0;
    MapCorrection correction;
    std::uint64_t graph_revision = 0;
  };
  std::optional<Found> found_;
  struct Place {
    std::uint64_t map = 0;
    MapOnEarth place;
    std::uint64_t graph_revision = 0;
  };
  std::optional<Place> place_;
  struct Submaps {
    std::uint64_t map = 0;
    SubmapList list;
  };
  std::optional<Submaps> submaps_;
  std::vector<GnssFix> fixes_;

  // Of the worker.
  std::uint64_t closed_map_ = 0;
  std::optional<LiveLoopCloser> closer_;
  std::size_t reported_ = 0;
  std::size_t reported_placed_ = 0;
  std::size_t reported_misplaced_ = 0;
  std::size_t handed_on_submaps_ = 0;
  ThrottledLog throttled_log_;

  /// The worker ended by a fault: nobody takes scans any more.
  std::stop_source failed_;
  BoundedQueue<ScanOfMap> scans_;
  // Last: stops before what it uses is gone.
  std::optional<Worker<ScanOfMap>> worker_;
};

}  // namespace stillmap::server
