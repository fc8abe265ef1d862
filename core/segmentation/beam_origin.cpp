#include "core/segmentation/beam_origin.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stillmap {
namespace {

/// Ground at the origin's height: cells of a metre around it in which nothing else is seen, and
/// that lie at 0 in the median, not as far below as a lidar near the floor has them.
bool lies_on_ground(std::span<const Eigen::Vector3f> points) {
  constexpr float reach_m = 20.0F, ground_m = 0.2F, max_median_m = 0.1F, below_m = -0.3F;
  constexpr int cells_across = 40, min_points = 3;
  constexpr std::size_t min_bare_cells = 100;
  constexpr double min_bare_share = 0.15, max_share_below = 0.1;
  struct Cell {
    int points = 0;
    bool is_bare = true;
    float sum_z_m = 0.0F;
  };
  std::vector<Cell> cells(cells_across * cells_across);
  std::size_t near = 0, below = 0;
  for (const Eigen::Vector3f& p : points) {
    if (!p.allFinite() || p.head<2>().squaredNorm() < 1.0F) continue;
    const Eigen::Vector2i at = (p.head<2>().array() + reach_m).floor().cast<int>();
    if (at.minCoeff() < 0 || at.maxCoeff() >= cells_across) continue;
    Cell& cell = cells[static_cast<std::size_t>(at.y() * cells_across + at.x())];
    ++cell.points;
    cell.sum_z_m += p.z();
    cell.is_bare = cell.is_bare && std::abs(p.z()) < ground_m;
    ++near;
    below += p.z() < below_m ? 1 : 0;
  }
  std::erase_if(cells, [](const Cell& cell) { return cell.points < min_points; });
  const double seen_cells = static_cast<double>(cells.size());
  std::erase_if(cells, [](const Cell& cell) { return !cell.is_bare; });
  if (cells.size() < min_bare_cells ||
      static_cast<double>(cells.size()) < min_bare_share * seen_cells ||
      static_cast<double>(below) > max_share_below * static_cast<double>(near))
    return false;
  const auto height_of = [](const Cell& cell) {
    return cell.sum_z_m / static_cast<float>(cell.points);
  };
  const auto middle = cells.begin() + static_cast<std::ptrdiff_t>(cells.size() / 2);
  std::ranges::nth_element(cells, middle, {}, height_of);
  return std::abs(height_of(*middle)) < max_median_m;
}

/// Where a point that stands up lies: away from the z axis, and above the origin [m].
struct Upright {
  float distance_m;
  float height_m;
};

std::vector<Upright> upright_points(std::span<const Eigen::Vector3f> points) {
  constexpr float min_height_m = 0.3F, min_distance_m = 2.0F;
  constexpr std::size_t max_points = 20'000;
  std::vector<Upright> upright;
  const std::size_t step = points.size() / max_points + 1;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3f& p = points[i];
    const float distance_m = p.head<2>().norm();
    if (p.allFinite() && p.z() > min_height_m && distance_m > min_distance_m)
      upright.push_back({distance_m, p.z()});
  }
  return upright;
}

/// Entropy of the slopes at which the points are seen from this height: the fewer there are, the
/// smaller.
double entropy_of_slopes(std::span<const Upright> points, double height_m) {
  constexpr float steepest = 2.0F, bin = 0.002F;
  std::array<std::uint32_t, 2001> histogram{};
  for (const Upright& p : points) {
    const float slope = (p.height_m - static_cast<float>(height_m)) / p.distance_m;
    if (std::abs(slope) >= steepest) continue;
    ++histogram[static_cast<std::size_t>((slope + steepest) / bin)];
  }
  double entropy = 0.0;
  for (const std::uint32_t count : histogram) {
    const double share = static_cast<double>(count) / static_cast<double>(points.size());
    if (count > 0) entropy -= share * std::log(share);
  }
  return entropy;
}

}  // namespace

std::optional<double> lidar_height_over_origin(std::span<const Eigen::Vector3f> points,
                                               double usual_height_m) {
  constexpr double step_m = 0.05, highest_m = 4.0, own_frame_m = 0.15;
  // What the entropy is compared with lies so many steps below and above.
  constexpr std::size_t reach = 6;
  constexpr std::size_t min_points = 500;
  // Compensated scans of KITTI, whose beams start 20 cm apart, have 0.07 to 0.4, others 1 and more.
  constexpr double min_depth = 0.05;
  // Half way there it is nearly as deep: what is broad is the shape of the place, not beams.
  constexpr std::size_t half_way = reach / 2;
  constexpr double min_steepness = 0.6;
  if (!lies_on_ground(points)) return std::nullopt;
  const std::vector<Upright> upright = upright_points(points);
  if (upright.size() < min_points) return usual_height_m;
  const auto heights = static_cast<std::size_t>(std::lround(highest_m / step_m)) + 1;
  std::vector<double> entropy;
  for (std::size_t k = 0; k < heights + 2 * reach; ++k)
    entropy.push_back(
        entropy_of_slopes(upright, step_m * (static_cast<double>(k) - static_cast<double>(reach))));
  double deepest = min_depth;
  double height_m = usual_height_m;
  for (std::size_t k = reach; k < heights + reach; ++k) {
    const double depth = std::min(entropy[k - reach], entropy[k + reach]) - entropy[k];
    if (depth <= deepest) continue;
    const double near_depth = std::min(entropy[k - half_way], entropy[k + half_way]) - entropy[k];
    if (near_depth < min_steepness * depth) continue;
    deepest = depth;
    height_m = step_m * static_cast<double>(k - reach);
  }
  return height_m < own_frame_m ? std::nullopt : std::optional(height_m);
}

}  // namespace stillmap
