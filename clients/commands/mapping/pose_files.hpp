#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/evaluation/trajectory_error.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap::cli {

/// Poses of a text file, in the frame of the file.
struct PoseFile {
  std::vector<Eigen::Isometry3d> poses;
  /// One a pose where the file has stamps (TUM), else empty.
  std::vector<std::int64_t> stamps_ns;
};

/// Reads KITTI's form (12 numbers a line, 3x4 row by row) or TUM's (seconds, x y z, qx qy qz qw;
/// lines that begin with # are comments). Throws DatasetError naming the file and line.
[[nodiscard]] PoseFile read_pose_file(const std::filesystem::path& file);

/// Writes TUM's form; a remark says that they are poses of `frame`. Throws DatasetError.
void write_tum(const std::filesystem::path& file, const Trajectory& trajectory,
               const std::string& frame = "lidar");

/// Writes KITTI's form. Throws DatasetError.
void write_kitti_poses(const std::filesystem::path& file, const Trajectory& trajectory);

/// TUM's form to a name that ends in .tum, else KITTI's. Throws DatasetError.
void write_poses_as_named(const std::filesystem::path& file, const Trajectory& trajectory,
                          const std::string& frame);

/// Pairs by stamp when both have stamps (at most `max_difference_ns` apart), else by index. Throws
/// std::invalid_argument.
[[nodiscard]] evaluation::PosePairs pair_poses(const PoseFile& truth, const PoseFile& estimate,
                                               std::int64_t max_difference_ns);

}  // namespace stillmap::cli
