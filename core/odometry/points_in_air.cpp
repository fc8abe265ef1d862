#include "core/odometry/points_in_air.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/odometry/isolated_points.hpp"
#include "core/odometry/ray_density.hpp"

namespace stillmap {
namespace {

/// Fewer points in the air than this share of the scan are none: edges of what is near, and stray
/// returns beside the vehicle, are up to 0.8 % of recorded scans.
constexpr double min_share_of_scan = 0.015;

/// Of drops and flakes a larger share than this is isolated: 0.75 where a tenth of all rays ends on
/// drops within some metres, else 0.93 and more; of crops and leaves beside the lidar 0.1 to 0.57.
constexpr double min_isolated_share = 0.66;

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
      : counts_(std::size_t{outside} + 1), places_(points.size()) {
    for (std::size_t i = 0; i < points.size(); i += lanes) {
      const std::size_t count = std::min(lanes, points.size() - i);
      place_some(points.subspan(i, count), std::span(places_).subspan(i, count));
    }
    for (const std::uint32_t place : places_) ++counts_[place];
  }
  /// Marks the cubes in which few rays end even of those that pass at the cube's inner side: of all
  /// others is_in_air() holds for no point. Returns how many points the marked ones have.
  std::size_t mark_thin(const RayDensity& rays) {
    is_thin_.assign(counts_.size(), 0);
    std::size_t count = 0;
    for (std::uint32_t place = 0; place < outside; ++place) {
      if (counts_[place] == 0 || is_surely_solid(place, rays)) continue;
      is_thin_[place] = 1;
      count += counts_[place];
    }
    return count;
  }
  /// Whether the i-th point is in a marked cube.
  [[nodiscard]] bool may_be_in_air(std::size_t i) const { return is_thin_[places_[i]] != 0; }
  /// Whether less than the share that is solid of the rays through the cube of the i-th point,
  /// which may be in the air, end there, and it is on no level surface.
  [[nodiscard]] bool is_in_air(std::size_t i, const Eigen::Vector3f& point,
                               const RayDensity& rays) const {
    const std::uint32_t shell = places_[i] / shell_size;
    const float cube_m = cube_of_shell_m(shell);
    const float squared_cube_m2 = cube_m * cube_m;
    const float steradians = squared_cube_m2 / std::max(point.squaredNorm(), squared_cube_m2);
    const float max_share = max_share_in_air / static_cast<float>(1U << shell);
    const auto count = static_cast<float>(counts_[places_[i]]);
    // Most points are on something solid by far.
    if (count >= max_share * steradians * rays.most_per_steradian()) return false;
    const float max_count = max_share * steradians * rays.per_steradian(point);
    return count < max_count && !is_on_level_surface(places_[i], max_count);
  }

 private:
  static constexpr std::uint32_t side = 2 * reach_cubes;
  static constexpr std::uint32_t shell_size = side * side * side;
  static constexpr std::uint32_t outside = shells * shell_size;

  /// So many points are placed at once, in vector registers.
  static constexpr std::size_t lanes = 64;

  static void place_some(std::span<const Eigen::Vector3f> points, std::span<std::uint32_t> places) {
    std::array<float, lanes> x{}, y{}, z{};
    for (std::size_t k = 0; k < points.size(); ++k) {
      x[k] = points[k].x();
      y[k] = points[k].y();
      z[k] = points[k].z();
    }
    std::array<std::uint32_t, lanes> place;
    for (std::size_t k = 0; k < lanes; ++k) place[k] = place_of(x[k], y[k], z[k]);
    std::copy_n(place.begin(), places.size(), places.begin());
  }
  /// Without branches, so that it is done for many at once.
  [[nodiscard]] static std::uint32_t place_of(float x, float y, float z) {
    static_assert(shells == 3);
    const float reach_m = std::max(std::max(std::abs(x), std::abs(y)), std::abs(z));
    const std::uint32_t shell =
        (reach_m < reach_of_shell_m(0) ? 0U : 1U) + (reach_m < reach_of_shell_m(1) ? 0U : 1U);
    const float cube_m = shell == 0   ? cube_of_shell_m(0)
                         : shell == 1 ? cube_of_shell_m(1)
                                      : cube_of_shell_m(2);
    const float shell_reach_m = cube_m * static_cast<float>(reach_cubes);
    const auto along = [&](float coordinate_m) {
      const float cubes = (coordinate_m + shell_reach_m) / cube_m;
      return static_cast<std::uint32_t>(
          static_cast<int>(std::min(std::max(0.0F, cubes), static_cast<float>(side - 1))));
    };
    const std::uint32_t place = shell * shell_size + (along(z) * side + along(y)) * side + along(x);
    return reach_m < reach_of_shell_m(2) ? place : outside;
  }

  [[nodiscard]] static constexpr float reach_of_shell_m(std::uint32_t shell) {
    return cube_of_shell_m(shell) * static_cast<float>(reach_cubes);
  }

  /// Whether is_in_air() holds for no point of a cube, with some room for rounding.
  [[nodiscard]] bool is_surely_solid(std::uint32_t place, const RayDensity& rays) const {
    constexpr float room = 1.01F;
    const std::uint32_t shell = place / shell_size;
    // From the lidar to the cube, in cubes.
    const auto squared_cubes = [](std::uint32_t k) {
      const std::uint32_t cubes = k < reach_cubes ? reach_cubes - 1 - k : k - reach_cubes;
      return cubes * cubes;
    };
    const auto squared =
        static_cast<float>(squared_cubes(place % side) + squared_cubes(place / side % side) +
                           squared_cubes(place / (side * side) % side));
    const float max_share = max_share_in_air / static_cast<float>(1U << shell);
    return static_cast<float>(counts_[place]) * std::max(squared, 1.0F) >=
           room * max_share * rays.most_per_steradian();
  }
  /// Whether `max_count` points and more lie in a cube and the one above or below it, on average of
  /// those beside it, and hardly any above or below these two: a level surface, which rays may meet
  /// at a flat angle, where cubes meet, or in but a corner of a cube. Rain goes on.
  [[nodiscard]] bool is_on_level_surface(std::uint32_t place, float max_count) const {
    const auto z = static_cast<int>(place / (side * side) % side);
    const auto is_surface = [&](int low) {
      constexpr float few = 0.125F;
      const float count = mean_count_of_level(place, low) + mean_count_of_level(place, low + 1);
      return count >= max_count && std::max(mean_count_of_level(place, low - 1),
                                            mean_count_of_level(place, low + 2)) < few * count;
    };
    return is_surface(z) || is_surface(z - 1);
  }
  /// Of the cubes of its shell up to one away from its column.
  [[nodiscard]] float mean_count_of_level(std::uint32_t place, int level) const {
    if (level < 0 || level >= static_cast<int>(side)) return 0.0F;
    const auto z = static_cast<std::uint32_t>(level);
    const std::uint32_t shell = place / shell_size;
    const std::uint32_t x = place % side;
    const std::uint32_t y = place / side % side;
    const auto is_inner = [](std::uint32_t k) { return k >= side / 4 && k < side - side / 4; };
    float count = 0.0F;
    float cubes = 0.0F;
    for (std::uint32_t v = y == 0 ? 0 : y - 1; v <= std::min(y + 1, side - 1); ++v)
      for (std::uint32_t u = x == 0 ? 0 : x - 1; u <= std::min(x + 1, side - 1); ++u) {
        // There smaller cubes have the points.
        if (shell > 0 && is_inner(u) && is_inner(v) && is_inner(z)) continue;
        count += static_cast<float>(counts_[shell * shell_size + (z * side + v) * side + u]);
        cubes += 1.0F;
      }
    return count / std::max(cubes, 1.0F);
  }

  std::vector<std::uint32_t> counts_;
  std::vector<std::uint32_t> places_;
  std::vector<std::uint8_t> is_thin_;
};

/// To the points that were found, all that are isolated, unless these were thin plants.
void add_isolated(std::span<const Eigen::Vector3f> points_lidar, RayDensity rays,
                  std::vector<bool>& in_air) {
  rays.count_sky();
  const std::vector<std::uint8_t> isolated =
      isolated_points(points_lidar, rays, in_air, min_isolated_share);
  for (std::size_t i = 0; i < isolated.size(); ++i)
    if (isolated[i] != 0) in_air[i] = true;
}

}  // namespace

std::vector<bool> points_in_air(std::span<const Eigen::Vector3f> points_lidar) {
  NearCubes cubes(points_lidar);
  const RayDensity rays(points_lidar);
  const double few = min_share_of_scan * static_cast<double>(points_lidar.size());
  if (static_cast<double>(cubes.mark_thin(rays)) < few) return {};
  std::vector<bool> in_air(points_lidar.size());
  std::size_t count = 0;
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    if (!cubes.may_be_in_air(i) || !cubes.is_in_air(i, points_lidar[i], rays)) continue;
    in_air[i] = true;
    ++count;
  }
  if (static_cast<double>(count) < few) return {};
  add_isolated(points_lidar, rays, in_air);
  return in_air;
}

}  // namespace stillmap
