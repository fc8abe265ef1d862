#include "core/session/map_alignment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/session/street_maps.hpp"

namespace stillmap {
namespace {

/// A drive along a stretch; its odometry begins at its first pose, and turns a little too much.
struct StreetDrive {
  StreetDrive(const StreetWorld& its_world, double from_m, double to_m, double drift_rad_per_m)
      : world(its_world) {
    const Eigen::Isometry3d drift(Eigen::AngleAxisd(drift_rad_per_m, Eigen::Vector3d::UnitZ()));
    Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
    for (double way = from_m; way < to_m; way += 1.0) {
      const Eigen::Isometry3d T_world_lidar = world.T_map_lidar_at(way, false);
      if (!T_world_lidars.empty())
        T_odom_lidar = T_odom_lidar * T_world_lidars.back().inverse() * T_world_lidar * drift;
      T_world_lidars.push_back(T_world_lidar);
      closer.add(scan_at(T_world_lidars.size() - 1), T_odom_lidar, true);
    }
    closer.finish();
  }
  [[nodiscard]] LabelledScan scan_at(std::size_t k) const {
    return world.scan_at(T_world_lidars[k], 5000 + k);
  }
  [[nodiscard]] MapAlignment align(const SavedMap& map) const {
    return MapAligner(index_of(map))
        .align(
            closer, [this](std::size_t k) { return scan_at(k); }, Eigen::Matrix3d::Identity());
  }

  const StreetWorld& world;
  LoopCloser closer{LoopClosingConfig{}};
  std::vector<Eigen::Isometry3d> T_world_lidars;
};

/// The map's frame lies elsewhere, and turned.
const Eigen::Isometry3d T_map_world =
    Eigen::Translation3d(30.0, -12.0, 2.0) * Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ());

double error_m(const MapAlignment& alignment, const StreetDrive& drive, std::size_t k) {
  return ((T_map_world * drive.T_world_lidars[k]).inverse() * alignment.T_map_lidar[k])
      .translation()
      .norm();
}

TEST(MapAligner, PutsADriveThatDriftsWhereItIsInTheMap) {
  const StreetWorld world(1);
  const SavedMap map = street_map(world, 0.0, 250.0, T_map_world, 1);
  const StreetDrive drive(world, 60.0, 180.0, 0.0005);
  const MapAlignment alignment = drive.align(map);
  ASSERT_TRUE(alignment.is_recognized()) << alignment.in_words();
  EXPECT_GE(alignment.closures.size(), 4U);
  ASSERT_EQ(alignment.T_map_lidar.size(), drive.T_world_lidars.size());
  for (std::size_t k = 0; k < alignment.T_map_lidar.size(); ++k)
    EXPECT_LT(error_m(alignment, drive, k), 0.15) << k;
  for (const MapClosure& closure : alignment.closures) {
    const Eigen::Isometry3d truth = T_map_world * drive.T_world_lidars[closure.scan];
    EXPECT_LT((truth.inverse() * closure.T_map_lidar).translation().norm(), 0.1);
  }
}

TEST(MapAligner, WhatLiesBesideTheMapHangsOnByOdometry) {
  const StreetWorld world(2);
  const SavedMap map = street_map(world, 0.0, 130.0, T_map_world, 1);
  const StreetDrive drive(world, 60.0, 230.0, 0.0);
  const MapAlignment alignment = drive.align(map);
  ASSERT_TRUE(alignment.is_recognized()) << alignment.in_words();
  for (std::size_t k = 0; k < alignment.T_map_lidar.size(); ++k)
    EXPECT_LT(error_m(alignment, drive, k), k < 70 ? 0.15 : 0.5) << k;
}

TEST(MapAligner, AnotherStreetIsNotRecognised) {
  const StreetWorld world(1), other(3);
  const SavedMap map = street_map(world, 0.0, 250.0, T_map_world, 1);
  const MapAlignment alignment = StreetDrive(other, 60.0, 180.0, 0.0).align(map);
  EXPECT_FALSE(alignment.is_recognized());
  EXPECT_GE(alignment.localized, 10U);
  EXPECT_THAT(alignment.in_words(), testing::HasSubstr("were looked for in the whole map"));
}

TEST(MapAligner, WhereTheSameHousesStandAgainNothingIsGuessed) {
  const StreetWorld world(1, 0.1 * StreetWorld::length_m);
  const SavedMap map = street_map(world, 0.0, 250.0, T_map_world, 1);
  const MapAlignment alignment = StreetDrive(world, 60.0, 180.0, 0.0).align(map);
  EXPECT_FALSE(alignment.is_recognized()) << alignment.in_words();
}

TEST(MapAligner, NothingIsNotRecognised) {
  const StreetWorld world(1);
  const SavedMap map = street_map(world, 0.0, 60.0, T_map_world, 1);
  EXPECT_FALSE(StreetDrive(world, 0.0, 0.0, 0.0).align(map).is_recognized());
  const StreetDrive drive(world, 0.0, 40.0, 0.0);
  EXPECT_FALSE(drive.align(street_map(world, 0.0, 0.0, T_map_world, 1)).is_recognized());
}

}  // namespace
}  // namespace stillmap
