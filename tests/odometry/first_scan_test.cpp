#include "core/odometry/first_scan.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "core/odometry/scan_features.hpp"

namespace stillmap {
namespace {

constexpr double interval_s = 0.1;
constexpr SweepTimes sweep{.duration_s = 0.1};

/// What a scan sees from there of a street along x: ground, walls, panels across it 3 m apart, the
/// first one so far on [m], and posts that stand irregularly, whose points alone tell the place.
FeatureSets street_with_panels(float lidar_x_m, float first_panel_m, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  std::normal_distribution<float> noise(0.0F, 0.005F);
  FeatureSets sets;
  const auto seen = [&](float x, float y, float z) {
    return FeaturePoint{
        .position_lidar = {x - lidar_x_m + noise(random), y + noise(random), z + noise(random)}};
  };
  for (int k = 0; k < 800; ++k) {
    const float side = k % 2 == 0 ? 6.0F : -6.0F;
    sets.surfaces.push_back(seen(20.0F * unit(random), 6.0F * unit(random), -1.7F));
    sets.surfaces.push_back(seen(20.0F * unit(random), side, 1.0F + 1.5F * unit(random)));
    sets.surfaces.push_back(seen(first_panel_m + 3.0F * static_cast<float>(k % 10 - 5),
                                 4.0F + 0.7F * unit(random), 1.0F + 1.5F * unit(random)));
  }
  std::mt19937 places(1);
  for (int post = 0; post < 40; ++post) {
    const float x = 20.0F * unit(places);
    const float y = 5.0F * unit(places);
    for (int k = 0; k < 8; ++k)
      sets.points.push_back(seen(x, y, 0.4F * static_cast<float>(k) - 1.0F));
  }
  return sets;
}

/// How far the second scan lies beyond the first one, which stands still by what was found [m].
double straightened_motion_m(const FeatureSets& second_features) {
  FirstScan first{.features = street_with_panels(0.0F, 0.0F, 7),
                  .sweep = sweep,
                  .T_map_stamp = Eigen::Isometry3d::Identity()};
  first.features.planes = first.features.surfaces;
  LocalMap map{LocalMapConfig{}};
  extend_local_map(map, first.features, first.T_map_stamp, {});
  const OdometryConfig config;
  const OdometryResult found =
      register_features(second_features, map, Eigen::Isometry3d::Identity(), config);
  const auto straightened = straighten_first_scan(first, {second_features, sweep, interval_s},
                                                  {map, Eigen::Isometry3d::Identity(), found},
                                                  config, /*max_speed_m_s=*/70.0);
  if (!straightened) return found.T_map_lidar.translation().x();
  return (straightened->T_map_first.inverse() * straightened->second.T_map_lidar).translation().x();
}

TEST(FirstScanTest, FeaturesThatAlsoFitFartherOnDoNotMoveALidarWhosePointsStay) {
  // Walls and ground hold it along the street no better.
  EXPECT_NEAR(straightened_motion_m(street_with_panels(0.0F, 1.5F, 8)), 0.0, 0.3)
      << "beams hit other panels, which fit at 15 m/s";
}

TEST(FirstScanTest, AMotionThatPointsAndFeaturesTellIsFoundFromNone) {
  EXPECT_NEAR(straightened_motion_m(street_with_panels(1.5F, 0.0F, 8)), 1.5, 0.05);
}

}  // namespace
}  // namespace stillmap
