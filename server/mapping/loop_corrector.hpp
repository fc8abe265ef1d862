#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
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
#include "core/odometry/odometry_state.hpp"
#include "core/waiting_scans.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/bounded_queue.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// Finds places that the robot comes back to, on a thread of its own, for the mapping thread to
/// correct the map by. All functions are the mapping thread's.
class LoopCorrector {
 public:
  /// Voxels of the running map that were first seen until a stamp, within a distance across of a
  /// place [m]: means and classes.
  using SeenUntil = std::function<std::vector<LabelledPoint>(
      std::int64_t stamp_ns, const Eigen::Vector2d& position_map, double radius_m)>;

  /// The statistics must outlive it, and what `seen_until` uses: the worker calls it.
  /// `is_lossless`: mapping waits where the search does not keep up; else the oldest scan that
  /// waits for it gives way. `antenna_base`: of the receiver whose fixes it gets, on the robot [m].
  LoopCorrector(const LiveLoopConfig& config, bool is_lossless, Statistics& statistics,
                SeenUntil seen_until, const Eigen::Vector3d& antenna_base = {0, 0, 0});

  /// A fix of the receiver. Thread-safe, unlike the others. Counted are those that are used
  /// ("gnss_fixes"), refused ("gnss_fixes_refused"), not between two scans of a moving robot
  /// ("gnss_fixes_between_no_scans"), and never looked at ("gnss_fixes_unused").
  void add(const GnssFix& fix);

  /// Another map began, which is empty.
  void begin_map() { begin_another({}); }
  /// A map was loaded, of which everything was seen until this stamp, and scans come after it. That
  /// stays where it is, and what is seen from now on is moved to where it fits to it. Fixes are not
  /// used.
  void begin_in_map(std::int64_t seen_until_ns) {
    begin_another({.earlier_until_ns = seen_until_ns});
  }
  /// A map was loaded, of which nobody knows until when it was seen: loops stay open in it.
  void begin_open();
  /// The same as begin_in_map of the running map, in which the robot was set elsewhere: odometry's
  /// frame is the map's again. Submaps keep their numbers. After a clock that was set back loops
  /// stay open.
  void go_on_in_map(std::int64_t seen_until_ns);
  /// The same where the robot is as it was: what take_full() asks for.
  void settle(std::int64_t seen_until_ns);
  /// From now on loops stay open.
  void end_map() { begin({}, std::move(told_)); }
  /// A scan of the map.
  void add(std::shared_ptr<const LabelledScan> labelled, const Eigen::Isometry3d& T_odom_lidar,
           const Eigen::Isometry3d& T_base_lidar, MapEntry entry);
  /// Scans that are not looked at yet.
  [[nodiscard]] std::size_t waiting() const { return scans_.waiting(); }
  /// What is to be moved, once; it has to be. Nothing after a clock that was set back: what was
  /// seen since then would be taken for what was seen before.
  [[nodiscard]] std::optional<MapCorrection> take();
  /// Where the map lies, when that was found out or found out better; once, and only as the map is:
  /// not between a correction and its report.
  [[nodiscard]] std::optional<MapOnEarth> take_place();
  /// Whether the place that was taken last is none any more; once.
  [[nodiscard]] bool take_withdrawal();
  /// Whether odometry may have drifted away from what was there before the run: as LoopCloser, and
  /// only as the map is.
  [[nodiscard]] bool is_off_earlier_map();
  /// Whether what is kept to find loops by has reached its limit, so that the map as it is shall be
  /// the earlier one of the rest: once, and only as the map is.
  [[nodiscard]] bool take_full();
  /// The submaps, by poses of the lidar, where there is another one or they were moved; once, and
  /// only as the map has them: not between a correction and its report.
  [[nodiscard]] std::optional<SubmapList> take_submaps();
  /// It was moved, within this time.
  void report(const MapCorrection& correction, const CorrectedMap& corrected, double ms);

 private:
  /// What scans are of.
  struct Run {
    /// Maps are numbered; 0: loops stay open.
    std::uint64_t map = 0;
    /// Of what was there before it.
    std::optional<std::int64_t> earlier_until_ns;
    /// When it began.
    Eigen::Isometry3d T_map_odom = Eigen::Isometry3d::Identity();
  };
  struct ScanOfMap {
    Run run;
    /// Null: another map begins.
    std::shared_ptr<const LabelledScan> labelled;
    Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
    Eigen::Vector3d antenna_lidar = Eigen::Vector3d::Zero();
    MapEntry entry = MapEntry::enters;
  };

  /// `submaps`: those of the map that were told until now.
  void begin(Run run, SubmapList submaps);
  /// Of a map whose clock is nobody's until now.
  void begin_another(Run run);

  // Of the worker.
  void look_at(const ScanOfMap& scan);
  void close(const ScanOfMap& scan, bool enters);
  [[nodiscard]] LiveLoopCloser closer_for(const Run& run) const;
  void hand_on_fixes(const Run& run);
  void hand_on_place(std::uint64_t map);
  void report_fixes();
  void report_closures();
  void count_new(const char* counter, std::size_t now, std::size_t& reported);
  void hand_on_submaps(std::uint64_t map);

  LiveLoopConfig config_;
  bool is_lossless_;
  Statistics& statistics_;
  SeenUntil seen_until_;
  Eigen::Vector3d antenna_base_;
  Run run_;
  std::uint64_t maps_ = 0;
  /// By what was corrected since the map began, or odometry's frame was the map's.
  Eigen::Isometry3d T_map_odom_ = Eigen::Isometry3d::Identity();
  /// Of the map's scans: corrections tell them apart by their stamps.
  std::int64_t last_stamp_ns_ = std::numeric_limits<std::int64_t>::min();
  bool is_clock_set_back_ = false;
  /// Of a map that was begun open.
  bool is_past_unknown_ = false;
  /// Those that were told last, and those of them that are of before the run.
  SubmapList told_;
  SubmapList earlier_submaps_;
  /// Of the graph, as the correction that was taken last makes the map, and as the map is.
  std::uint64_t taken_revision_ = 0;
  std::uint64_t map_revision_ = 0;
  bool is_off_earlier_map_ = false;

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
  struct OffEarlierMap {
    std::uint64_t map = 0;
    bool is_off = false;
    std::uint64_t graph_revision = 0;
  };
  OffEarlierMap off_earlier_map_;
  struct Full {
    std::uint64_t map = 0;
    std::uint64_t graph_revision = 0;
  };
  std::optional<Full> full_;
  /// Of which map the place is none any more.
  std::uint64_t withdrawn_map_ = 0;
  std::vector<GnssFix> fixes_;

  // Of the worker.
  std::uint64_t closed_map_ = 0;
  /// That a fix was last refused for, as it is not this run's alone.
  std::uint64_t map_without_fixes_ = 0;
  /// Of the map that is looked at, it was known.
  bool had_place_ = false;
  std::optional<LiveLoopCloser> closer_;
  /// Of the map that is looked at; those that stay out between them are left out.
  WaitingScans<ScanOfMap> waiting_;
  std::size_t reported_ = 0;
  std::size_t reported_anchors_ = 0;
  std::size_t reported_placed_ = 0;
  std::size_t reported_misplaced_ = 0;
  std::size_t reported_doubted_ = 0;
  double reported_delay_s_ = 0.0;
  bool were_refused_ = false;
  std::size_t handed_on_submaps_ = 0;
  ThrottledLog throttled_log_;

  /// The worker ended by a fault: nobody takes scans any more.
  std::stop_source failed_;
  BoundedQueue<ScanOfMap> scans_;
  // Last: stops before what it uses is gone.
  std::optional<Worker<ScanOfMap>> worker_;
};

}  // namespace stillmap::server
