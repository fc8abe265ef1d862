#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// One revolution of the lidar. Every per-point vector is either empty ("not known") or as long
/// as `points_lidar`.
struct Scan {
  /// Time of the scan's reference, nanoseconds since the Unix epoch (or since the start of
  /// the dataset).
  std::int64_t stamp_ns = 0;
  /// Frame of the lidar: x forward, y left, z up [m].
  std::vector<Eigen::Vector3f> points_lidar;
  /// Reflected intensity, 0..1.
  std::vector<float> intensity;
  /// Time of each point relative to `stamp_ns` [s]; empty when the scan is motion-compensated.
  std::vector<float> time_offset_s;
  /// Beam of each point in the source's own numbers, which may begin at the top or, as Velodyne's
  /// drivers do, at the bottom; empty when unknown. assign_rings() gives 0 = highest for all.
  std::vector<std::uint16_t> ring;
  /// Class of each point where the dataset has labels (reduced to the network's classes).
  std::vector<SemanticClass> labels;

  [[nodiscard]] std::size_t size() const { return points_lidar.size(); }
  [[nodiscard]] bool empty() const { return points_lidar.empty(); }
};

}  // namespace stillmap
