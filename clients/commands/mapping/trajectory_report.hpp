#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "core/evaluation/absolute_trajectory_error.hpp"
#include "core/evaluation/pose_pairs.hpp"
#include "core/evaluation/relative_pose_error.hpp"
#include "core/picture/trajectory_picture.hpp"

namespace stillmap {

/// All figures of an estimated trajectory against the truth.
struct TrajectoryReport {
  std::size_t poses = 0;
  double path_m = 0.0;
  AbsoluteError unaligned;
  AbsoluteError first_aligned;
  AbsoluteError rigid_aligned;
  std::optional<RelativeError> relative;
  std::optional<KittiOdometryError> kitti;
};

[[nodiscard]] TrajectoryReport report_trajectory(const PosePairs& pairs);

/// As a table for people.
[[nodiscard]] std::string describe(const TrajectoryReport& report);
[[nodiscard]] nlohmann::json to_json(const TrajectoryReport& report);

/// Writes trajectory.png (both paths, best rigid fit) and trajectory_error.png (error over
/// distance) into the folder; returns their names. Throws std::runtime_error.
std::vector<std::filesystem::path> draw_trajectories(const std::filesystem::path& folder,
                                                     const PosePairs& pairs,
                                                     const TrajectoryReport& report,
                                                     GroundPlane plane);

}  // namespace stillmap
