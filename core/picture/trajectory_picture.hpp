#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace stillmap {

/// Which two axes of the world a picture from above shows.
enum class GroundPlane {
  /// x to the right, y up: worlds with z up (lidar, map).
  xy,
  /// x to the right, z up: KITTI's camera frame, where y points down.
  xz,
};

/// Both paths from above on one scale in metres, the start marked. Throws std::runtime_error naming
/// the file when it cannot be written.
void write_path_picture(const std::filesystem::path& file, std::span<const Eigen::Vector3d> truth,
                        std::span<const Eigen::Vector3d> estimate, GroundPlane plane);

/// One line of a chart.
struct ChartLine {
  std::string title;
  std::vector<double> y;
};

/// Lines over a shared, growing x, for instance error [m] over distance [m]. Every line is as long
/// as `x`. Throws std::runtime_error naming the file when it cannot be written.
void write_chart(const std::filesystem::path& file, const std::string& x_title,
                 std::span<const double> x, std::span<const ChartLine> lines);

}  // namespace stillmap
