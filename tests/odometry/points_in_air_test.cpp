#include "core/odometry/points_in_air.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <random>
#include <vector>

#include "core/odometry/features.hpp"
#include "core/odometry/isolated_points.hpp"

namespace stillmap {
namespace {

/// A lidar of 32 rings over 40 degrees, 1.8 m above a road, with a wall, a pole of 5 cm and a bush
/// beside it.
struct Rain {
  std::vector<Eigen::Vector3f> points_lidar;
  std::vector<std::uint16_t> rings;
  std::vector<bool> is_drop;

  /// `share` of the rays end on drops, most of them within some metres, or on flakes anywhere up to
  /// 15 m.
  Rain(double share, unsigned seed, bool is_snow = false) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    std::exponential_distribution<double> way(1.0 / 1.5);
    constexpr int ring_count = 32;
    constexpr int columns = 900;
    for (int ring = 0; ring < ring_count; ++ring)
      for (int column = 0; column < columns; ++column) {
        const double elevation = (15.0 - 40.0 * ring / (ring_count - 1)) * std::numbers::pi / 180.0;
        const double azimuth = 2.0 * std::numbers::pi * column / columns;
        const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                                  std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
        const double range_m = range_of(ray, uniform(random));
        const double drop_m = 0.6 + (is_snow ? 14.4 * uniform(random) : way(random));
        const bool ends_on_drop = uniform(random) < share && drop_m < range_m;
        if (!ends_on_drop && range_m > 80.0) continue;
        points_lidar.push_back(
            (std::min(range_m, drop_m + 100.0 * (ends_on_drop ? 0.0 : 1.0)) * ray).cast<float>());
        rings.push_back(static_cast<std::uint16_t>(ring));
        is_drop.push_back(ends_on_drop);
      }
  }

 private:
  static double range_of(const Eigen::Vector3d& ray, double depth) {
    double range_m = ray.z() < 0.0 ? -1.8 / ray.z() : 1000.0;
    if (ray.y() > 0.0) range_m = std::min(range_m, 6.0 / ray.y());
    range_m = std::min(range_m, range_to_cylinder(ray, {3.0, -1.0}, 0.025));
    const double bush_m = range_to_cylinder(ray, {-3.0, -2.0}, 0.8);
    return std::min(range_m, bush_m + depth);
  }
  static double range_to_cylinder(const Eigen::Vector3d& ray, const Eigen::Vector2d& centre,
                                  double radius_m) {
    const double a = ray.head<2>().squaredNorm();
    const double b = ray.head<2>().dot(centre);
    const double root = b * b - a * (centre.squaredNorm() - radius_m * radius_m);
    return root < 0.0 || b < 0.0 ? 1000.0 : (b - std::sqrt(root)) / a;
  }
};

TEST(PointsInAir, AreDropsAndNothingSolid) {
  for (const double share : {0.03, 0.05, 0.10, 0.20}) {
    const Rain rain(share, 7);
    const std::vector<bool> in_air = points_in_air(rain.points_lidar);
    ASSERT_EQ(in_air.size(), rain.points_lidar.size()) << share;
    double drops = 0.0, found = 0.0, solid = 0.0, mistaken = 0.0;
    for (std::size_t i = 0; i < in_air.size(); ++i) {
      (rain.is_drop[i] ? drops : solid) += 1.0;
      if (in_air[i]) (rain.is_drop[i] ? found : mistaken) += 1.0;
    }
    EXPECT_GT(found, 0.85 * drops) << share;
    EXPECT_LT(mistaken, 0.003 * solid) << share;
  }
}

TEST(PointsInAir, AreFlakesAsFarAsTheyAreSeenAndCloseAboveTheGround) {
  for (const double share : {0.05, 0.15, 0.40}) {
    const Rain snow(share, 9, /*is_snow=*/true);
    const std::vector<bool> in_air = points_in_air(snow.points_lidar);
    ASSERT_EQ(in_air.size(), snow.points_lidar.size()) << share;
    double flakes = 0.0, found = 0.0, solid = 0.0, mistaken = 0.0;
    for (std::size_t i = 0; i < in_air.size(); ++i) {
      (snow.is_drop[i] ? flakes : solid) += 1.0;
      if (in_air[i]) (snow.is_drop[i] ? found : mistaken) += 1.0;
    }
    EXPECT_GT(found, 0.9 * flakes) << share;
    EXPECT_LT(mistaken, 0.02 * solid) << share;
  }
}

/// The rule in its plainest form: every point by the rays through its own cube.
class PlainRule {
 public:
  explicit PlainRule(const std::vector<Eigen::Vector3f>& points) {
    for (std::size_t i = 0; i < points.size(); i += 7) rays_[bin_of(points[i])] += 7.0F;
    for (int bin = 0; bin < bins; ++bin) most_ = std::max(most_, rays_at(bin));
    for (const Eigen::Vector3f& point : points) ++counts_[cube_of(point)];
  }
  [[nodiscard]] bool is_in_air(const Eigen::Vector3f& point) const {
    const Cube cube = cube_of(point);
    if (cube[0] < 0) return false;
    const float cube_m = 0.3F * static_cast<float>(1 << cube[0]);
    const float steradians = cube_m * cube_m / std::max(point.squaredNorm(), cube_m * cube_m);
    const float share = 0.06F / static_cast<float>(1 << cube[0]);
    const auto count = static_cast<float>(counts_.at(cube));
    const float max_count = share * steradians * rays_at(bin_of(point));
    return count < share * steradians * most_ && count < max_count &&
           !is_level(cube, cube[3], max_count) && !is_level(cube, cube[3] - 1, max_count);
  }

 private:
  /// Shell, x, y, z.
  using Cube = std::array<int, 4>;
  static constexpr int bins = 50;

  static int bin_of(const Eigen::Vector3f& point) {
    const float sine = point.z() / std::max(point.norm(), 1e-3F);
    return std::min(static_cast<int>(std::max(sine + 1.0F, 0.0F) / 0.04F), bins - 1);
  }
  [[nodiscard]] float rays_at(int bin) const {
    const int first = std::max(bin - 1, 0), last = std::min(bin + 1, bins - 1);
    float count = 0.0F;
    for (int k = first; k <= last; ++k) count += rays_.at(static_cast<std::size_t>(k));
    return count /
           (2.0F * std::numbers::pi_v<float> * 0.04F * static_cast<float>(last - first + 1));
  }
  static Cube cube_of(const Eigen::Vector3f& point) {
    for (int shell = 0; shell < 3; ++shell) {
      const float cube_m = 0.3F * static_cast<float>(1 << shell), reach_m = 10.0F * cube_m;
      if (point.cwiseAbs().maxCoeff() >= reach_m) continue;
      const auto along = [&](float m) {
        return std::min(static_cast<int>((m + reach_m) / cube_m), 19);
      };
      return {shell, along(point.x()), along(point.y()), along(point.z())};
    }
    return {-1, 0, 0, 0};
  }
  [[nodiscard]] bool is_level(const Cube& cube, int low, float max_count) const {
    const float count = mean(cube, low) + mean(cube, low + 1);
    return count >= max_count &&
           std::max(mean(cube, low - 1), mean(cube, low + 2)) < 0.125F * count;
  }
  [[nodiscard]] float mean(const Cube& cube, int z) const {
    const auto is_inner = [](int k) { return k >= 5 && k < 15; };
    float count = 0.0F, cubes = 0.0F;
    for (int y = cube[2] - 1; y <= cube[2] + 1; ++y)
      for (int x = cube[1] - 1; x <= cube[1] + 1; ++x) {
        if (std::min({x, y, z}) < 0 || std::max({x, y, z}) > 19) continue;
        if (cube[0] > 0 && is_inner(x) && is_inner(y) && is_inner(z)) continue;
        const auto found = counts_.find({cube[0], x, y, z});
        if (found != counts_.end()) count += static_cast<float>(found->second);
        cubes += 1.0F;
      }
    return count / std::max(cubes, 1.0F);
  }

  std::array<float, bins> rays_{};
  float most_ = 0.0F;
  std::map<Cube, int> counts_;
};

TEST(PointsInAir, AreThoseOfThePlainRuleAndWhatIsIsolated) {
  for (const double share : {0.03, 0.10, 0.20}) {
    const std::vector<Eigen::Vector3f> points = Rain(share, 11).points_lidar;
    const PlainRule rule(points);
    const std::vector<bool> in_air = points_in_air(points);
    ASSERT_EQ(in_air.size(), points.size());
    RayDensity rays(points);
    rays.count_sky();
    const std::vector<std::uint8_t> isolated =
        isolated_points(points, rays, std::vector<bool>(points.size(), true), 0.0);
    double count = 0.0, isolated_count = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (rule.is_in_air(points[i])) {
        count += 1.0;
        isolated_count += isolated[i] != 0 ? 1.0 : 0.0;
      }
    const bool are_drops = isolated_count >= 0.66 * count;
    for (std::size_t i = 0; i < points.size(); ++i)
      EXPECT_EQ(in_air[i], rule.is_in_air(points[i]) || (are_drops && isolated[i] != 0))
          << share << ": " << points[i].transpose();
  }
}

TEST(PointsInAir, ThePoleStays) {
  const Rain rain(0.10, 8);
  const std::vector<bool> in_air = points_in_air(rain.points_lidar);
  ASSERT_FALSE(in_air.empty());
  int of_pole = 0, kept = 0;
  for (std::size_t i = 0; i < in_air.size(); ++i) {
    const Eigen::Vector3f& point = rain.points_lidar[i];
    if ((point.head<2>() - Eigen::Vector2f(3.0F, -1.0F)).norm() > 0.05F || rain.is_drop[i])
      continue;
    ++of_pole;
    kept += in_air[i] ? 0 : 1;
  }
  ASSERT_GT(of_pole, 20);
  EXPECT_GT(kept, 0.9 * of_pole);
}

TEST(PointsInAir, AreNoneInClearAirAndInEmptyScans) {
  EXPECT_TRUE(points_in_air(Rain(0.0, 9).points_lidar).empty());
  EXPECT_TRUE(points_in_air({}).empty());
  const std::vector<Eigen::Vector3f> at_the_lidar(100, Eigen::Vector3f::Zero());
  EXPECT_TRUE(points_in_air(at_the_lidar).empty());
}

/// Rings [degrees] as a VLP-32C has them: close together at the horizon, far apart below it.
constexpr std::array uneven_rings{-25.0,  -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667,
                                  -4.0,   -3.667,  -3.333, -3.0,   -2.667, -2.333, -2.0,   -1.667,
                                  -1.333, -1.0,    -0.667, -0.333, 0.0,    0.333,  0.667,  1.0,
                                  1.333,  1.667,   2.333,  3.333,  4.667,  7.0,    10.333, 15.0};

/// Ground, and walls all round, below and about a lidar with these rings.
std::vector<Eigen::Vector3f> low_lidar_scan(double height_m, double walls_m) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.01);
  std::vector<Eigen::Vector3f> points;
  for (const double ring_deg : uneven_rings)
    for (int column = 0; column < 900; ++column) {
      const double elevation = ring_deg * std::numbers::pi / 180.0;
      const double azimuth = 2.0 * std::numbers::pi * column / 900;
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      const double wall_m = walls_m / ray.head<2>().cwiseAbs().maxCoeff();
      const double ground_m = ray.z() < 0.0 ? -height_m / ray.z() : wall_m;
      points.push_back(((std::min(wall_m, ground_m) + noise(random)) * ray).cast<float>());
    }
  return points;
}

TEST(PointsInAir, AreNoneOfTheGroundBelowALowLidarOfUnevenRings) {
  for (const double height_m : {0.3, 0.6})
    for (const double walls_m : {2.0, 5.0, 15.0})
      EXPECT_TRUE(points_in_air(low_lidar_scan(height_m, walls_m)).empty())
          << height_m << " m high, walls " << walls_m << " m away";
}

TEST(ExtractSurfaces, LeavesOutWhatHangsInTheAir) {
  const Rain rain(0.10, 10);
  Scan scan;
  scan.points_lidar = rain.points_lidar;
  const Features features = extract_surfaces(scan, FeatureConfig{});
  for (const auto* kind : {&features.planes, &features.surfaces, &features.points}) {
    double drops = 0.0;
    for (const std::uint32_t i : *kind) drops += rain.is_drop[i] ? 1.0 : 0.0;
    EXPECT_LT(drops, 0.15 * static_cast<double>(kind->size()));
  }
}

TEST(ExtractFeatures, FindsSurfacesOfRingsBetweenFlakes) {
  const auto planes_of = [](double share) {
    const Rain snow(share, 9, /*is_snow=*/true);
    Scan scan;
    scan.points_lidar = snow.points_lidar;
    scan.ring = snow.rings;
    return static_cast<double>(extract_features(scan, FeatureConfig{}).planes.size());
  };
  EXPECT_GT(planes_of(0.15), 0.7 * planes_of(0.0));
}

}  // namespace
}  // namespace stillmap
