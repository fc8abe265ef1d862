#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/odometry/odometry_state.hpp"

namespace stillmap {

/// A scan as it entered the map.
struct LoggedScan {
  /// Number of the scan in its sequence.
  std::uint64_t index = 0;
  Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
  /// Only scans that enter the map or may do so later have points.
  MapEntry entry = MapEntry::enters;
  /// See MappedScan.
  bool begins_elsewhere = false;
  /// Points [m] in steps of 4 mm, or of 1/32767 of the log's reach; classes; confidence in 1/255;
  /// motion. Points beyond the reach, or beyond 131 m where that is more, are nearer on their rays.
  LabelledScan labelled;
};

/// Scans with labels and motion, compressed in a file that grows: what a map is made of again
/// after its poses were corrected. What a killed process left incomplete at its end is dropped.
class ScanLog {
 public:
  /// Opens or makes it. `reach_m`: points up to there come back where they were. Throws
  /// DatasetError.
  ScanLog(std::filesystem::path file, double reach_m);

  /// Throws DatasetError.
  void append(const LoggedScan& scan);
  /// What was appended is in the file. Throws DatasetError.
  void flush();

  [[nodiscard]] std::size_t size() const { return records_.size(); }
  /// The scan at this place in the order of their appending. Throws DatasetError where the file is
  /// damaged.
  [[nodiscard]] LoggedScan at(std::size_t place);
  /// Every scan in the order of their appending. Throws DatasetError for a file that is damaged.
  void read(const std::function<void(LoggedScan)>& take);
  /// Drops the scans from this number on. Throws DatasetError.
  void truncate_from(std::uint64_t index);

  [[nodiscard]] std::uintmax_t bytes() const { return end_; }

 private:
  /// Takes stock of complete records: their places.
  void scan_records();

  std::filesystem::path file_;
  float step_m_;
  std::fstream stream_;
  struct Record {
    std::uint64_t index;
    std::uintmax_t offset;
  };
  std::vector<Record> records_;
  std::uintmax_t end_ = 0;
};

}  // namespace stillmap
