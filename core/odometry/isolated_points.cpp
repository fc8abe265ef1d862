#include "core/odometry/isolated_points.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stillmap {
namespace {

/// Flakes farther away come back from few lidars [m].
constexpr float reach_m = 20.0F;
/// So many rays beside a point's own are looked at: they end within some degrees of it. Nearer
/// than this, and range noise [m].
constexpr float rays_beside = 25.0F;
constexpr float range_noise_m = 0.1F;
/// A point with so many of them near it is on something.
constexpr int enough_near = 2;
/// Angle within which they are [rad], at least and at most.
constexpr float min_angle_rad = 0.01F;
constexpr float max_angle_rad = 0.06F;

float angle_of(float per_steradian) {
  const float angle_rad =
      std::sqrt(rays_beside / (std::numbers::pi_v<float> * std::max(per_steradian, 1.0F)));
  return std::clamp(angle_rad, min_angle_rad, max_angle_rad);
}

/// Points by their direction: those of one cell, and of the shells of cells round it, are all that
/// are within an angle of a direction in it.
class Directions {
 public:
  Directions(std::span<const Eigen::Vector3f> points, float angle_rad)
      : cells_to_axis_end_(
            std::clamp(static_cast<std::size_t>(1.0F / angle_rad), min_cells, max_cells)),
        side_(2 * (cells_to_axis_end_ + max_shells) + 1),
        shells_(shells(static_cast<std::int64_t>(side_))),
        cells_(points.size()),
        order_(points.size()),
        begins_(side_ * side_ * side_ + 1) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      cells_[i] = cell_of(points[i]);
      ++begins_[cells_[i] + 1];
    }
    for (std::size_t cell = 1; cell < begins_.size(); ++cell) begins_[cell] += begins_[cell - 1];
    std::vector<std::uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (std::size_t i = 0; i < points.size(); ++i)
      order_[next[cells_[i]]++] = static_cast<std::uint32_t>(i);
  }

  /// Whether fewer than `enough_near` other points are within an angle of the i-th, of at most
  /// `max_angle_rad`, and no more than that in range from it.
  [[nodiscard]] bool is_alone(std::span<const Eigen::Vector3f> points, std::size_t i,
                              float angle_rad) const {
    int near = 0;
    const float squared_m2 = angle_rad * angle_rad * points[i].squaredNorm();
    const auto middle = static_cast<std::int64_t>(cells_[i]);
    const auto reach =
        static_cast<std::size_t>(std::ceil(angle_rad * static_cast<float>(cells_to_axis_end_)));
    const std::size_t across = 2 * std::min(reach, max_shells) + 1;
    // The own cell first: most points are on something, and have enough of it there.
    for (const std::int64_t step : std::span(shells_).first(across * across * across)) {
      const auto cell = static_cast<std::size_t>(middle + step);
      for (std::uint32_t k = begins_[cell]; k < begins_[cell + 1]; ++k) {
        const std::uint32_t other = order_[k];
        if (other == i || (points[other] - points[i]).squaredNorm() > squared_m2) continue;
        if (++near >= enough_near) return false;
      }
    }
    return true;
  }

 private:
  static constexpr std::size_t min_cells = 16;
  /// More of them take longer to clear than the points in them to look at.
  static constexpr std::size_t max_cells = 40;
  static constexpr std::size_t max_shells = 3;
  static_assert(max_angle_rad * max_cells <= max_shells);

  [[nodiscard]] std::size_t cell_of(const Eigen::Vector3f& point) const {
    const Eigen::Vector3f direction = point / std::max(point.norm(), 1e-3F);
    const auto along = [this](float part) {
      const float cells = (part + 1.0F) * static_cast<float>(cells_to_axis_end_);
      return max_shells +
             std::min(static_cast<std::size_t>(std::max(cells, 0.0F)), 2 * cells_to_axis_end_);
    };
    return (along(direction.z()) * side_ + along(direction.y())) * side_ + along(direction.x());
  }
  /// Steps from a cell to itself, and to those of the shells round it, in a cube with rows of so
  /// many.
  static std::vector<std::int64_t> shells(std::int64_t row) {
    std::vector<std::int64_t> steps;
    const auto last = static_cast<std::int64_t>(max_shells);
    for (std::int64_t shell = 0; shell <= last; ++shell)
      for (std::int64_t z = -shell; z <= shell; ++z)
        for (std::int64_t y = -shell; y <= shell; ++y)
          for (std::int64_t x = -shell; x <= shell; ++x)
            if (std::max({std::abs(x), std::abs(y), std::abs(z)}) == shell)
              steps.push_back((z * row + y) * row + x);
    return steps;
  }

  /// Along an edge of the cube round all directions, with shells beyond them at each end.
  std::size_t cells_to_axis_end_;
  std::size_t side_;
  std::vector<std::int64_t> shells_;
  std::vector<std::size_t> cells_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> begins_;
};

/// Of cells: what nearly all of these are narrower than. Few are wide, of points where hardly any
/// ray went.
float width_for(std::vector<float> angles_rad) {
  const auto high = angles_rad.begin() + static_cast<std::ptrdiff_t>(angles_rad.size() * 19 / 20);
  std::ranges::nth_element(angles_rad, high);
  return *high;
}

/// Marks those of these points that are isolated; returns how many.
std::size_t mark(std::span<const Eigen::Vector3f> points, std::span<const float> angles_rad,
                 const Directions& directions, std::span<const std::uint32_t> asked,
                 std::vector<std::uint8_t>& isolated) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, asked.size(), 512), [&](const auto& range) {
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      const std::uint32_t i = asked[k];
      const float range_m = points[i].norm();
      if (range_m > reach_m) continue;
      const float noise_rad = range_noise_m / std::max(range_m, 1e-3F);
      const float beside_rad = std::min(std::hypot(angles_rad[i], noise_rad), max_angle_rad);
      isolated[i] = directions.is_alone(points, i, beside_rad) ? 1 : 0;
    }
  });
  return static_cast<std::size_t>(
      std::ranges::count_if(asked, [&](std::uint32_t i) { return isolated[i] != 0; }));
}

}  // namespace

std::vector<std::uint8_t> isolated_points(std::span<const Eigen::Vector3f> points_lidar,
                                          const RayDensity& rays, const std::vector<bool>& first,
                                          double min_share) {
  std::vector<float> angles_rad(points_lidar.size());
  std::vector<std::uint32_t> asked_first, others;
  for (std::uint32_t i = 0; i < points_lidar.size(); ++i) {
    angles_rad[i] = angle_of(rays.per_steradian(points_lidar[i]));
    (first[i] ? asked_first : others).push_back(i);
  }
  if (asked_first.empty()) return {};
  const Directions directions(points_lidar, width_for(angles_rad));
  std::vector<std::uint8_t> isolated(points_lidar.size());
  const auto found =
      static_cast<double>(mark(points_lidar, angles_rad, directions, asked_first, isolated));
  if (found < min_share * static_cast<double>(asked_first.size())) return {};
  mark(points_lidar, angles_rad, directions, others, isolated);
  return isolated;
}

}  // namespace stillmap
