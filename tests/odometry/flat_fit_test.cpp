#include "core/odometry/flat_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>
#include <utility>

#include "core/odometry/odometry.hpp"
#include "core/odometry/scan_features.hpp"
#include "tests/odometry/poses.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap {
namespace {

/// Points of a room of 20 m by 12 m, or of grass that moves in the wind: 0.6 m high, and anywhere
/// in it, up to so many times as far.
FeatureSets points_round_the_lidar(bool is_grass, unsigned seed, float reach = 1.0F) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  std::normal_distribution<float> noise(0.0F, 0.02F);
  FeatureSets sets;
  const auto add = [&](float x, float y, float z) {
    sets.surfaces.push_back(
        {.position_lidar = {x + noise(random), y + noise(random), z + noise(random)}});
  };
  for (int k = 0; k < 1000; ++k) {
    if (is_grass) {
      add(10.0F * reach * unit(random), 6.0F * reach * unit(random), -1.0F + 0.3F * unit(random));
    } else {
      add(k % 2 == 0 ? 10.0F : -10.0F, 6.0F * unit(random), unit(random));
      add(10.0F * unit(random), k % 2 == 0 ? 6.0F : -6.0F, unit(random));
      add(10.0F * unit(random), 6.0F * unit(random), -1.0F);
    }
  }
  return sets;
}

LocalMap map_of(bool is_grass) {
  LocalMap map{LocalMapConfig{}};
  for (unsigned seed = 1; seed <= 5; ++seed) {
    FeatureSets sets;
    sets.planes = points_round_the_lidar(is_grass, seed, is_grass ? 1.2F : 1.0F).surfaces;
    extend_local_map(map, sets, Eigen::Isometry3d::Identity(), {});
  }
  return map;
}

OdometryHealth doubted_health(FlatFit& fit, const LocalMap& map, bool is_grass, unsigned seed) {
  const FeatureSets features = points_round_the_lidar(is_grass, seed);
  const OdometryConfig config;
  OdometryResult found = register_features(features, map, Eigen::Isometry3d::Identity(), config);
  EXPECT_NE(found.health, OdometryHealth::lost);
  found.health = OdometryHealth::good;
  return fit.doubted(found, features, map, config).health;
}

TEST(FlatFit, IsDoubtedInGrassAndBelievedAgainBetweenWalls) {
  const LocalMap grass = map_of(/*is_grass=*/true);
  const LocalMap room = map_of(/*is_grass=*/false);
  FlatFit fit;
  for (unsigned k = 0; k < 5; ++k)
    EXPECT_EQ(doubted_health(fit, room, false, 20 + k), OdometryHealth::good) << k;
  for (unsigned k = 0; k < 20; ++k) {
    const OdometryHealth health = doubted_health(fit, grass, true, 40 + k);
    if (k >= 10) {
      EXPECT_EQ(health, OdometryHealth::degenerate) << k;
    }
  }
  for (unsigned k = 0; k < 5; ++k) {
    const OdometryHealth health = doubted_health(fit, room, false, 80 + k);
    if (k >= 2) {
      EXPECT_EQ(health, OdometryHealth::good) << k;
    }
  }
}

/// Where a ray from 1.2 m above the ground ends between rows of crops that sway, 0.75 m apart and 1
/// m high [m]; more than 60 where it does not.
double range_over_crops(const Eigen::Vector3d& ray, double rest_m) {
  constexpr double step_m = 0.05;
  constexpr double row_m = 0.75;
  const double ground_m = ray.z() < 0.0 ? -1.2 / ray.z() : 1000.0;
  for (double range_m = ray.z() < 0.0 ? -0.2 / ray.z() : 1000.0; range_m < std::min(60.0, ground_m);
       range_m += step_m) {
    const double y_m = range_m * ray.y();
    if (std::abs(std::remainder(y_m - 0.5 * row_m, row_m)) > 0.175) continue;
    rest_m -= step_m;
    if (rest_m < 0.0) return range_m;
  }
  return ground_m;
}

/// What a lidar of 64 rings sees there.
Scan scan_over_crops(double x_m, double time_s, std::mt19937& random) {
  std::exponential_distribution<double> way_into_crops(1.0 / 0.25);
  std::uniform_real_distribution<float> in_tree(-1.5F, 1.5F);
  // The robot sways, too.
  const Eigen::Matrix3d R_field_lidar =
      so3_exp({0.012 * std::sin(8.7 * time_s), 0.012 * std::sin(7.1 * time_s), 0.0});
  Scan scan;
  scan.stamp_ns = std::llround(1e9 * (10.0 + time_s));
  const auto add = [&](const Eigen::Vector3f& point, int ring) {
    scan.points_lidar.push_back(point);
    scan.intensity.push_back(0.3F);
    scan.ring.push_back(static_cast<std::uint16_t>(ring));
  };
  for (int ring = 0; ring < 64; ++ring)
    for (int column = 0; column < 300; ++column) {
      const double elevation = (22.5 - 45.0 * ring / 63) * std::numbers::pi / 180.0;
      const double azimuth = 2.0 * std::numbers::pi * column / 300;
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      const double range_m = range_over_crops(R_field_lidar * ray, way_into_crops(random));
      if (range_m < 60.0) add((range_m * ray).cast<float>(), ring);
    }
  // A row of trees beside the field, which passes by.
  for (int tree = 0; tree < 12; ++tree)
    for (int k = 0; k < 12; ++k)
      add({static_cast<float>(-40.0 + 9.0 * tree - x_m) + in_tree(random), 45.0F + in_tree(random),
           3.0F + in_tree(random)},
          std::max(0, 31 - k));
  return scan;
}

TEST(FlatFit, SaysNothingOfFeaturesOfSingleRings) {
  const LocalMap grass = map_of(/*is_grass=*/true);
  const OdometryConfig config;
  FeatureSets features = points_round_the_lidar(/*is_grass=*/true, 7);
  OdometryResult found = register_features(features, grass, Eigen::Isometry3d::Identity(), config);
  found.health = OdometryHealth::good;
  features.planes = std::move(features.surfaces);
  features.surfaces.clear();
  FlatFit fit;
  for (int k = 0; k < 40; ++k)
    EXPECT_EQ(fit.doubted(found, features, grass, config).health, OdometryHealth::good) << k;
}

TEST(FlatFit, APoseThatHoldsOnToCropsIsNotGood) {
  SensorModel sensor = hdl_64e();
  sensor.fov_up = 22.5 * std::numbers::pi / 180.0;
  sensor.fov_down = -sensor.fov_up;
  Odometry odometry(OdometryConfig{}, sensor);
  std::mt19937 random(3);
  double x_m = 0.0;
  int off = 0;
  int good_though_off = 0;
  for (int k = 0; k < 60; ++k) {
    x_m += 0.15 * std::min(1.0, 0.1 * k);
    const OdometryResult result =
        test::register_scan(odometry, scan_over_crops(x_m, 0.1 * k, random), {}).result;
    const bool is_off = std::abs(result.T_map_lidar.translation().x() - x_m) > 1.0;
    off += is_off ? 1 : 0;
    good_though_off += is_off && result.health == OdometryHealth::good ? 1 : 0;
  }
  EXPECT_LE(good_though_off, 2) << "of " << off;
}

}  // namespace
}  // namespace stillmap
