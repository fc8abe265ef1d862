#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/graph/loop_closer.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/submap_list.hpp"

namespace stillmap {

struct LiveLoopConfig {
  LoopClosingConfig closing;
  GnssConfig gnss;
  /// A correction that moves nothing by this much waits for the next one: half a voxel [m].
  double min_shift_m = 0.1;
  /// How far from the lidar things are that a turn is to move by that [m].
  double range_m = 20.0;
  /// Scans nearer than this to the last one that was looked at are not: a robot may stand for days
  /// [m, rad].
  double scan_spacing_m = 0.1;
  double scan_turn_rad = 0.02;
  /// Of all submaps.
  std::size_t max_submap_bytes = std::size_t{1} << 30;
  /// Of the graph of a run in an earlier map: each place that is found again costs a solution of
  /// all.
  std::size_t max_nodes = 5000;
};

/// Where a map lies on the earth.
struct MapOnEarth {
  Datum datum;
  /// The map in `earth` of REP 105 (ECEF).
  Eigen::Isometry3d T_earth_map = Eigen::Isometry3d::Identity();
};

/// Closes the loops of a map that grows meanwhile, and uses the fixes of a receiver: says what of
/// the map must be moved. NOT thread safe.
class LiveLoopCloser {
 public:
  explicit LiveLoopCloser(const LiveLoopConfig& config)
      : config_(config), closer_(config.closing), gnss_(config.gnss) {}
  /// Of a run that goes on in a map which holds scans until this stamp: see LoopCloser.
  LiveLoopCloser(const LiveLoopConfig& config, EarlierMap earlier, std::int64_t seen_until_ns)
      : config_(config),
        closer_(config.closing, std::move(earlier)),
        gnss_(config.gnss),
        last_stamp_ns_(seen_until_ns),
        is_in_earlier_map_(true) {}

  /// A fix, before or after the scans around it. Returns why it is not used; empty where it is.
  [[nodiscard]] std::string add(const GnssFix& fix);

  /// As LoopCloser.
  [[nodiscard]] LoopCloser::PositionCounts position_counts() const {
    return closer_.position_counts();
  }

  [[nodiscard]] bool are_positions_refused() const { return closer_.are_positions_refused(); }

  /// The next scan of the map, by a pose that no correction moved, with the place of the receiver's
  /// antenna on its lidar. A correction is of the map as the corrections before have left it, and
  /// is taken to be carried out.
  [[nodiscard]] std::optional<MapCorrection> add(const LabelledScan& scan,
                                                 const Eigen::Isometry3d& T_odom_lidar,
                                                 bool is_confirmed,
                                                 const Eigen::Vector3d& antenna_lidar = {0, 0, 0});

  /// Believed so far.
  [[nodiscard]] const std::vector<LoopClosure>& closures() const { return closer_.closures(); }
  /// Submaps that were found in the earlier map.
  [[nodiscard]] std::size_t anchors() const { return closer_.anchors().size(); }
  /// As LoopCloser, by the corrections until now; not after the end.
  [[nodiscard]] bool is_off_earlier_map() const { return closer_.is_off_earlier_map(); }
  /// Whether what is kept of the drive has reached its limit: then the map as it is shall be the
  /// earlier one of the rest. Submaps are dropped at once; a graph that is too large waits until
  /// its newest submap lies where it belongs.
  [[nodiscard]] bool is_full() const;
  /// What became of the fixes.
  [[nodiscard]] const GnssTrack& gnss() const { return gnss_; }
  /// By the corrections until now; nothing while it is not known.
  [[nodiscard]] std::optional<MapOnEarth> on_earth() const;
  /// The submaps as they are in the map once the last correction is carried out; after the end, as
  /// they were then.
  [[nodiscard]] SubmapList submaps() const;
  [[nodiscard]] std::size_t submap_count() const {
    return end_reason_.empty() ? closer_.submaps().size() : last_submaps_.submaps.size();
  }
  /// How many there were.
  [[nodiscard]] std::uint64_t corrections() const { return corrections_; }
  [[nodiscard]] std::size_t submap_bytes() const { return closer_.submap_bytes(); }
  [[nodiscard]] std::size_t scans_looked_at() const { return stamps_ns_.size(); }
  /// Why no more loops are closed; empty while they are.
  [[nodiscard]] const std::string& end_reason() const { return end_reason_; }

 private:
  [[nodiscard]] std::optional<MapCorrection> correction();

  [[nodiscard]] bool has_moved(const Eigen::Isometry3d& T_odom_lidar) const;
  /// Frees what was kept to find loops by.
  void end(const char* reason);

  LiveLoopConfig config_;
  LoopCloser closer_;
  GnssTrack gnss_;
  std::int64_t last_stamp_ns_ = std::numeric_limits<std::int64_t>::min();
  /// Of the scans that were looked at.
  std::vector<std::int64_t> stamps_ns_;
  Eigen::Isometry3d T_odom_lidar_last_ = Eigen::Isometry3d::Identity();
  /// As they are in the map.
  std::vector<Eigen::Isometry3d> T_map_lidar_;
  /// Of scans to come.
  Eigen::Isometry3d T_map_odom_ = Eigen::Isometry3d::Identity();
  /// Whether anything corrected poses until now.
  bool was_corrected_ = false;
  std::size_t known_submaps_ = 0;
  std::uint64_t corrections_ = 0;
  std::string end_reason_;
  bool is_in_earlier_map_ = false;
  bool has_dropped_submaps_ = false;
  SubmapList last_submaps_;
};

}  // namespace stillmap
