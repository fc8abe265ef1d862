#include "core/session/common_drive.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace stillmap {
namespace {

constexpr std::size_t min_poses = 8;

bool have_equal_stamps(const Trajectory& a, const Trajectory& b, std::size_t poses) {
  for (std::size_t i = 1; i < poses; ++i) {
    if (a[i].stamp_ns - a[0].stamp_ns != b[i].stamp_ns - b[0].stamp_ns) return false;
  }
  return true;
}

/// From each pose to the next one, in the frame of the first of them [m].
std::vector<Eigen::Vector3d> steps_of(const Trajectory& path, std::size_t poses) {
  std::vector<Eigen::Vector3d> steps;
  for (std::size_t i = 1; i < poses; ++i) {
    steps.push_back((path[i - 1].T_map_lidar.inverse() * path[i].T_map_lidar).translation());
  }
  return steps;
}

/// Median length of the second differences [m]: what changes steadily is in none of them.
double median_jump_m(const std::vector<Eigen::Vector3d>& steps) {
  std::vector<double> jumps;
  for (std::size_t i = 2; i < steps.size(); ++i) {
    const double jump_m = (steps[i] - 2.0 * steps[i - 1] + steps[i - 2]).norm();
    // What is not a number has no place in an order.
    jumps.push_back(std::isfinite(jump_m) ? jump_m : std::numeric_limits<double>::max());
  }
  const auto middle = jumps.begin() + static_cast<std::ptrdiff_t>(jumps.size() / 2);
  std::ranges::nth_element(jumps, middle);
  return *middle;
}

}  // namespace

bool are_of_one_drive(const Trajectory& a, const Trajectory& b) {
  // A correction is spread evenly over the scans of a submap: what steps differ by then grows
  // steadily, by some thousandths of their jumps. The jumps of two drives differ by more than they
  // are long.
  constexpr double largest_share = 0.05;
  // Steps are of poses whose digits end there, some km from the origin.
  constexpr double rounding_m = 1e-9;
  const std::size_t poses = std::min(a.size(), b.size());
  if (poses < min_poses || !have_equal_stamps(a, b, poses)) return false;
  const std::vector<Eigen::Vector3d> steps = steps_of(a, poses);
  std::vector<Eigen::Vector3d> differences = steps_of(b, poses);
  for (std::size_t i = 0; i < steps.size(); ++i) differences[i] -= steps[i];
  const double jump_m = median_jump_m(steps);
  return jump_m > rounding_m && median_jump_m(differences) < largest_share * jump_m;
}

}  // namespace stillmap
