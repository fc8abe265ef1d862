#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "core/graph/loop_closer.hpp"
#include "core/graph/scan_log.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/map/static_map.hpp"
#include "core/mapper.hpp"
#include "core/session/map_alignment.hpp"

namespace stillmap::cli {

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
};

/// How loops are closed.
struct LoopOptions {
  /// Where the scans are kept meanwhile.
  std::filesystem::path scans_file;
  /// Scans as they are numbered in the data set.
  std::vector<DeniedLoop> denied;
};

/// Finds loops while a run goes on, and keeps its scans in a file until it ends, since the map is
/// made of them again where poses were corrected.
class LoopCorrection {
 public:
  /// Throws DatasetError.
  LoopCorrection(LoopOptions options, const SensorModel& sensor);

  /// Goes on with the scans before this number, which are in the file. Throws DatasetError.
  void resume(std::size_t next_scan);
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
  /// is called after every scan. Throws DatasetError.
  void insert_into(StaticMap& map, const std::vector<Eigen::Isometry3d>& T_map_lidar,
                   std::int64_t clock_offset_ns,
                   const std::function<void(std::size_t done)>& scan_done);
  [[nodiscard]] LoopReport report() const;

 private:
  /// One more scan, by its number in the data set.
  void number(std::size_t index);

  std::vector<DeniedLoop> denied_;
  SensorModel sensor_;
  ScanLog log_;
  LoopCloser closer_;
  /// Of the scans added, in the data set.
  std::vector<std::size_t> index_;
  std::vector<Eigen::Isometry3d> T_odom_lidar_;
  std::vector<Eigen::Isometry3d> T_map_lidar_;
  double seconds_ = 0.0;
};

}  // namespace stillmap::cli
