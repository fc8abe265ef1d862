#include "core/odometry/isolated_points.hpp"

#include <cmath>
#include <cstdint>

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

/// Points by their direction: those of one cell, and the 26 round it, are all within an angle of a
/// direction in it.
class Directions {
 public:
  explicit Directions(std::span<const Eigen::Vector3f> points)
      : cells_(points.size()), order_(points.size()), begins_(side * side * side + 1) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      cells_[i] = cell_of(points[i]);
      ++begins_[cells_[i] + 1];
    }
    for (std::size_t cell = 1; cell < begins_.size(); ++cell) begins_[cell] += begins_[cell - 1];
    std::vector<std::uint32_t> next(begins_.begin(), begins_.end() - 1);
    for (std::size_t i = 0; i < points.size(); ++i)
      order_[next[cells_[i]]++] = static_cast<std::uint32_t>(i);
  }

  /// Whether fewer than `enough_near` other points are within `distance_m` of the i-th.
  [[nodiscard]] bool is_alone(std::span<const Eigen::Vector3f> points, std::size_t i,
                              float distance_m) const {
    int near = 0;
    const float squared_m2 = distance_m * distance_m;
    const auto middle = static_cast<std::int64_t>(cells_[i]);
    // The own cell first: most points are on something, and have enough of it there.
    for (const std::int64_t step : neighbours()) {
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
  /// Along an edge of the cube round all directions, with one cell beyond them at each end.
  static constexpr std::size_t cells_to_axis_end = 17;
  static constexpr std::size_t side = 2 * cells_to_axis_end + 3;
  static_assert(1.0F / cells_to_axis_end < max_angle_rad);

  static std::size_t cell_of(const Eigen::Vector3f& point) {
    const Eigen::Vector3f direction = point / std::max(point.norm(), 1e-3F);
    const auto along = [](float part) {
      const float cells = (part + 1.0F) * static_cast<float>(cells_to_axis_end);
      return 1 + std::min(static_cast<std::size_t>(std::max(cells, 0.0F)), side - 3);
    };
    return (along(direction.z()) * side + along(direction.y())) * side + along(direction.x());
  }
  static const std::array<std::int64_t, 27>& neighbours() {
    static const auto steps = [] {
      std::array<std::int64_t, 27> all{};
      std::size_t k = 1;
      constexpr auto row = static_cast<std::int64_t>(side);
      for (std::int64_t z = -1; z <= 1; ++z)
        for (std::int64_t y = -1; y <= 1; ++y)
          for (std::int64_t x = -1; x <= 1; ++x)
            if (x != 0 || y != 0 || z != 0) all[k++] = (z * row + y) * row + x;
      return all;
    }();
    return steps;
  }

  std::vector<std::size_t> cells_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> begins_;
};

}  // namespace

std::vector<bool> isolated_points(std::span<const Eigen::Vector3f> points_lidar,
                                  const RayDensity& rays) {
  const Directions directions(points_lidar);
  std::vector<bool> isolated(points_lidar.size());
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    const float range_m = points_lidar[i].norm();
    if (range_m > reach_m) continue;
    const float beside_m = range_m * angle_of(rays.per_steradian(points_lidar[i]));
    isolated[i] = directions.is_alone(points_lidar, i, std::hypot(beside_m, range_noise_m));
  }
  return isolated;
}

}  // namespace stillmap
