#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// Movable points of a scan, grouped into things that move as one.
struct ObjectClusters {
  static constexpr std::int32_t none = -1;
  /// For every point of the scan its object, `none` for points that are not movable.
  std::vector<std::int32_t> of_point;
  std::size_t count = 0;
  /// Those that have one, in the order of the scan.
  std::vector<std::uint32_t> movable_points{};
  /// From the lowest to the highest point of every object [m].
  std::vector<float> height_m{};
  /// Diagonal of its bounding box in the lidar's xy plane, to a cube's size [m].
  std::vector<float> length_m{};
  /// Whether most of its points are labelled car.
  std::vector<bool> is_car{};
};

/// Groups movable points of the same kind (vehicles; people; two-wheelers and their riders) that
/// touch: cubes of `gap_m` that are neighbours, also over a corner.
[[nodiscard]] ObjectClusters cluster_objects(std::span<const Eigen::Vector3f> points_lidar,
                                             std::span<const SemanticClass> labels, double gap_m);

}  // namespace stillmap
