#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "clients/terminal/json.hpp"
#include "core/evaluation/trajectory_error.hpp"
#include "core/picture/trajectory_picture.hpp"

namespace stillmap::cli {

/// All figures of an estimated trajectory against the truth.
struct TrajectoryReport {
  std::size_t poses = 0;
  double path_m = 0.0;
  evaluation::AbsoluteTrajectoryError unaligned;
  evaluation::AbsoluteTrajectoryError first_aligned;
  evaluation::AbsoluteTrajectoryError rigid_aligned;
  std::optional<evaluation::RelativePoseError> relative;
  std::optional<evaluation::KittiOdometryError> kitti;
};

[[nodiscard]] TrajectoryReport report_trajectory(const evaluation::PosePairs& pairs);

/// As a table for people.
[[nodiscard]] std::string describe(const TrajectoryReport& report);
[[nodiscard]] Json to_json(const TrajectoryReport& report);

/// Writes trajectory.png (both paths, best rigid fit) and trajectory_error.png (error over
/// distance) into the folder; returns their names. Throws std::runtime_error.
std::vector<std::filesystem::path> draw_trajectories(const std::filesystem::path& folder,
                                                     const evaluation::PosePairs& pairs,
                                                     const TrajectoryReport& report,
                                                     GroundPlane plane);

}  // namespace stillmap::cli
