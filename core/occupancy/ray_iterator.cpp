#include "core/occupancy/ray_iterator.hpp"

#include <limits>

namespace stillmap {

RayIterator::RayIterator(const Eigen::Vector3d& start, const Eigen::Vector3d& direction)
    : voxel_(start.array().floor().cast<std::int32_t>()) {
  constexpr double never = std::numeric_limits<double>::infinity();
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const bool forwards = direction[axis] > 0.0;
    const double speed = std::abs(direction[axis]);
    step_[axis] = forwards ? 1 : -1;
    const double in_voxel = start[axis] - voxel_[axis];
    const bool moves = speed > 0.0;
    next_at_[axis] = moves ? (forwards ? 1.0 - in_voxel : in_voxel) / speed : never;
    voxel_length_[axis] = moves ? 1.0 / speed : never;
  }
  choose_axis();
}

}  // namespace stillmap
