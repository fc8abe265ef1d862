#include "core/odometry/points_in_air.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace stillmap {
namespace {

/// Fewer points in the air than this share of the scan are none: edges of what is near, and stray
/// returns beside the vehicle, are up to 0.8 % of recorded scans.
constexpr double min_share_of_scan = 0.015;

/// Shells about the lidar, each of cubes twice as large as those of the one within: as many rays
/// pass through a cube at its inner side.
constexpr std::uint32_t shells = 3;
constexpr std::uint32_t reach_cubes = 10;
constexpr float first_cube_m = 0.3F;
/// Share of the rays through a cube that end in it, in the first shell, and half of it in each that
/// follows, since the air is the clearer the farther one looks: 2 % in rain that a tenth of all
/// rays meet, above 10 % on poles of 5 cm, a third in foliage.
constexpr float max_share_in_air = 0.06F;

constexpr float cube_of_shell_m(std::uint32_t shell) {
  return first_cube_m * static_cast<float>(1U << shell);
}

/// Points within reach, by cubes.
class NearCubes {
 public:
  explicit NearCubes(std::span<const Eigen::Vector3f> points)
      : counts_(std::size_t{shells} * shell_size), places_(points.size()) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      places_[i] = place_of(points[i]);
      if (places_[i] != outside) ++counts_[places_[i]];
    }
  }
  /// Whether less than the share that is solid of the rays through the cube of the i-th point end
  /// there.
  [[nodiscard]] bool is_in_air(std::size_t i, const Eigen::Vector3f& point,
                               float rays_per_steradian) const {
    if (places_[i] == outside) return false;
    const std::uint32_t shell = places_[i] / shell_size;
    const float cube_m = cube_of_shell_m(shell);
    const float squared_cube_m2 = cube_m * cube_m;
    const float rays_through =
        rays_per_steradian * squared_cube_m2 / std::max(point.squaredNorm(), squared_cube_m2);
    const float max_share = max_share_in_air / static_cast<float>(1U << shell);
    return static_cast<float>(counts_[places_[i]]) < max_share * rays_through;
  }

 private:
  static constexpr std::uint32_t side = 2 * reach_cubes;
  static constexpr std::uint32_t shell_size = side * side * side;
  static constexpr std::uint32_t outside = ~std::uint32_t{0};

  [[nodiscard]] static std::uint32_t place_of(const Eigen::Vector3f& point) {
    const float reach_m = point.cwiseAbs().maxCoeff();
    for (std::uint32_t shell = 0; shell < shells; ++shell) {
      const float cube_m = cube_of_shell_m(shell);
      const float shell_reach_m = cube_m * static_cast<float>(reach_cubes);
      if (!(reach_m < shell_reach_m)) continue;
      const auto along = [&](float coordinate_m) {
        return std::min(static_cast<std::uint32_t>((coordinate_m + shell_reach_m) / cube_m),
                        side - 1);
      };
      return shell * shell_size + (along(point.z()) * side + along(point.y())) * side +
             along(point.x());
    }
    return outside;
  }

  std::vector<std::uint32_t> counts_;
  std::vector<std::uint32_t> places_;
};

/// As if they went all round, between the outermost elevations: no more than there are.
float rays_per_steradian(std::span<const Eigen::Vector3f> points) {
  constexpr std::size_t one_of = 7;
  float low = 1.0F;
  float high = -1.0F;
  for (std::size_t i = 0; i < points.size(); i += one_of) {
    const Eigen::Vector3f& point = points[i];
    const float sine = point.z() / std::max(point.norm(), 1e-3F);
    low = std::min(low, sine);
    high = std::max(high, sine);
  }
  constexpr float min_band = 0.1F;
  return static_cast<float>(points.size()) /
         (2.0F * std::numbers::pi_v<float> * std::max(high - low, min_band));
}

}  // namespace

std::vector<bool> points_in_air(std::span<const Eigen::Vector3f> points_lidar) {
  const NearCubes cubes(points_lidar);
  const float rays = rays_per_steradian(points_lidar);
  std::vector<bool> in_air(points_lidar.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    in_air[i] = cubes.is_in_air(i, points_lidar[i], rays);
    count += in_air[i] ? 1 : 0;
  }
  if (static_cast<double>(count) < min_share_of_scan * static_cast<double>(points_lidar.size()))
    in_air.clear();
  return in_air;
}

}  // namespace stillmap
