#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap {

/// Files and folders beside one another that are read as one sequence.
inline constexpr std::array sequence_parts{
    "velodyne",  "labels",    "labels.bak",  "rings",           "time_offsets",
    "calib.txt", "times.txt", "poses.txt",   "poses_lidar.txt", "imu.csv",
    "imu.txt",   "gnss.csv",  "sensor.yaml", "axes.txt"};

/// Says that points have our axes (x ahead, y left, z up), whatever names say.
inline constexpr const char* axes_file_name = "axes.txt";

/// The first of them that the folder holds; empty where it holds none.
[[nodiscard]] std::filesystem::path part_of_sequence_in(const std::filesystem::path& folder);

/// Writes scans as a SemanticKITTI sequence: velodyne/, labels/, calib.txt, times.txt and
/// poses.txt (camera frame, relative to the first scan, as KITTI has it). What .bin cannot hold
/// goes into files of our own that ScanDataset reads back: time_offsets/NNNNNN.bin (float32 a
/// point, seconds) and rings/NNNNNN.bin (uint16 a point). axes.txt says that the points have our
/// axes, so that what `PointFieldNames` put right once is not turned back.
class KittiSequenceWriter {
 public:
  /// Makes the folders. Throws DatasetError when that fails or `folder` holds a part of a
  /// sequence already.
  explicit KittiSequenceWriter(const std::filesystem::path& folder);

  /// Writes the next scan at once. `raw_labels` is empty or has one entry a point. Stamps must not
  /// be negative: times.txt keeps them as they are. Throws DatasetError, and then leaves nothing of
  /// this scan and completes those before it, as finish() does.
  void add(const Scan& scan, std::span<const std::uint32_t> raw_labels,
           const Eigen::Isometry3d& T_map_lidar);

  /// Writes calib.txt, times.txt and poses.txt. Throws DatasetError.
  void finish() const;

 private:
  void write_files(const std::string& name, const Scan& scan,
                   std::span<const std::uint32_t> raw_labels) const;
  void remove_files(const std::string& name) const;
  void finish_if_possible() const;

  std::filesystem::path folder_;
  Trajectory trajectory_;
};

}  // namespace stillmap
