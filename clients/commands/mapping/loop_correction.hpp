#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/geodesy/datum.hpp"
#include "core/geodesy/gnss_track.hpp"
#include "core/graph/loop_closer.hpp"
#include "core/graph/scan_log.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/map/static_map.hpp"
#include "core/mapper.hpp"
#include "core/session/map_alignment.hpp"

namespace stillmap::cli {

/// What became of a receiver's fixes in a run.
struct GnssReport {
  std::size_t fixes = 0;
  /// Why the first one of those that were not used was not; and how many.
  std::string refusal;
  std::size_t refused = 0;
  /// Put between scans; of these in the graph; of these in doubt.
  std::size_t placed = 0;
  LoopCloser::PositionCounts positions;
  /// Too many contradict odometry: none corrects the map.
  bool are_refused = false;
  /// Of the stamps, and what the antenna is off; as found out, or configured.
  GnssDelay delay;
  /// Where the map's frame lies; nothing where that did not become known.
  std::optional<Datum> datum;
  /// What the map's z axis is off the vertical [rad].
  double tilt_rad = 0.0;
};

/// What closing loops found and cost in a run.
struct LoopReport {
  /// Scans by their numbers in the data set.
  std::vector<LoopClosure> closures;
  std::vector<LoopClosure> refused;
  std::size_t submaps = 0;
  std::size_t nodes = 0;
  double submap_mib = 0.0;
  double scan_log_mib = 0.0;
  /// How far the correction moved a pose at most [m].
  double max_correction_m = 0.0;
  double seconds = 0.0;
  /// Nothing without a receiver.
  std::optional<GnssReport> gnss;
};

/// A receiver on the robot.
struct GnssOptions {
  /// By the scans' clock.
  std::vector<GnssFix> fixes;
  /// Where its antenna is on the lidar [m].
  Eigen::Vector3d antenna_lidar = Eigen::Vector3d::Zero();
  GnssConfig config;
};

/// How loops are closed.
struct LoopOptions {
  /// Where the scans are kept meanwhile.
  std::filesystem::path scans_file;
  /// So far scans go into the map.
  double max_range_m = 0.0;
  /// Scans as they are numbered in the data set.
  std::vector<DeniedLoop> denied;
  GnssOptions gnss;
};

/// Finds loops while a run goes on, and keeps its scans in a file until it ends, since the map is
/// made of them again where poses were corrected.
class LoopCorrection {
 public:
  /// Throws DatasetError.
  LoopCorrection(LoopOptions options, const SensorModel& sensor);

  /// Goes on with the scans before this number, which are in the file: those of `poses` poses at
  /// least. Throws DatasetError.
  void resume(std::size_t next_scan, std::size_t poses);
  /// The scan of this number in the data set. Throws DatasetError.
  void add(std::size_t index, const MappedScan& mapped);
  void flush() { log_.flush(); }
  [[nodiscard]] std::size_t scan_count() const { return index_.size(); }

  /// The run ended. Returns whether poses changed.
  [[nodiscard]] bool finish();
  /// Poses of all scans that were added.
  [[nodiscard]] const std::vector<Eigen::Isometry3d>& T_map_lidar() const { return T_map_lidar_; }
  /// Where the drive lies in an earlier map, after `finish`. Throws DatasetError.
  [[nodiscard]] MapAlignment align(const std::shared_ptr<const PlaceIndex>& map,
                                   const Eigen::Matrix3d& R_body_lidar);
  /// Adds all scans to a map by these poses, their stamps later by `clock_offset_ns`. `scan_done`
  /// is called after every scan; where it returns false the rest is left out, and so does this.
  /// Throws DatasetError.
  [[nodiscard]] bool insert_into(StaticMap& map, const std::vector<Eigen::Isometry3d>& T_map_lidar,
                                 std::int64_t clock_offset_ns,
                                 const std::function<bool(std::size_t done)>& scan_done);
  [[nodiscard]] LoopReport report() const;

 private:
  /// The next scan. One that waits, and those after it, are handed to the closer once it is decided
  /// where they are.
  void add(const LoggedScan& scan);
  /// Hands those to the closer that have waited for this entry.
  void close_waiting(MapEntry entry);
  /// Leaves out those with stamps before that.
  void skip_fixes(std::int64_t until_ns);
  /// Those with stamps until then.
  void add_fixes(std::int64_t until_ns);
  /// Hands a scan to the closer, with the fixes until then.
  void close(std::size_t place, const LabelledScan& scan, bool enters);
  [[nodiscard]] GnssReport gnss_report() const;

  /// By their stamps.
  std::vector<GnssFix> fixes_;
  std::size_t next_fix_ = 0;
  std::string refusal_;
  std::size_t refused_fixes_ = 0;
  Eigen::Vector3d antenna_lidar_;
  /// So far from the scans fixes may have their stamps.
  std::int64_t reach_ns_;
  /// Of the newest scan that the closer has.
  std::int64_t last_stamp_ns_ = 0;
  GnssTrack gnss_;
  SensorModel sensor_;
  std::filesystem::path scans_file_;
  ScanLog log_;
  LoopCloser closer_;
  /// Of the scans added, in the data set.
  std::vector<std::size_t> index_;
  std::vector<Eigen::Isometry3d> T_odom_lidar_;
  /// Of those that the closer has: whether they enter the map. Of the rest: whether they may.
  std::vector<bool> enters_;
  std::vector<bool> may_enter_;
  std::vector<Eigen::Isometry3d> T_map_lidar_;
  double seconds_ = 0.0;
};

}  // namespace stillmap::cli
