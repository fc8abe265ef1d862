#pragma once

#include <Eigen/Geometry>
#include <sstream>
#include <string>
#include <vector>

namespace stillmap::test {

/// The text of a file of poses: one a line, 3x4 row by row.
inline std::vector<Eigen::Isometry3d> kitti_poses(const std::string& text) {
  std::istringstream lines(text);
  std::vector<Eigen::Isometry3d> poses;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream numbers(line);
    Eigen::Isometry3d& T = poses.emplace_back(Eigen::Isometry3d::Identity());
    for (int i = 0; i < 12; ++i) numbers >> T.matrix()(i / 4, i % 4);
  }
  return poses;
}

}  // namespace stillmap::test
