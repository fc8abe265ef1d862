#include "core/session/map_alignment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/session/street_maps.hpp"

namespace stillmap {
namespace {

/// A drive whose odometry begins at its first pose.
struct StreetDrive {
  explicit StreetDrive(const StreetWorld& its_world) : world(its_world) {}
  /// Along a stretch; odometry turns a little too much.
  StreetDrive(const StreetWorld& its_world, double from_m, double to_m, double drift_rad_per_m)
      : world(its_world) {
    const Eigen::Isometry3d drift(Eigen::AngleAxisd(drift_rad_per_m, Eigen::Vector3d::UnitZ()));
    for (double way = from_m; way < to_m; way += 1.0)
      go(world.T_map_lidar_at(way, false), [&](const Eigen::Isometry3d& T) { return T * drift; });
    closer.finish();
  }
  /// One scan; `erring` makes of the motion to there what odometry says.
  template <typename Erring>
  void go(const Eigen::Isometry3d& T_world_lidar, const Erring& erring) {
    if (!T_world_lidars.empty())
      T_odom_lidar =
          T_odom_lidar * erring(Eigen::Isometry3d(T_world_lidars.back().inverse() * T_world_lidar));
    T_world_lidars.push_back(T_world_lidar);
    closer.add(scan_at(T_world_lidars.size() - 1), T_odom_lidar, true);
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
  Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
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

/// On 70 m of the street, far away, and back for 170 m, when odometry has drifted by a jump in
/// height. On the way since then its scale is wrong, and its height, from 200 to 222 m, by a hump.
struct DriveThatComesBack : StreetDrive {
  DriveThatComesBack(const StreetWorld& its_world, double jump_m, double scale_error, double hump_m)
      : StreetDrive(its_world) {
    const auto erring = [](double scale, double up_m) {
      return [=](Eigen::Isometry3d T) {
        T.translation() = scale * T.translation() + up_m * Eigen::Vector3d::UnitZ();
        return T;
      };
    };
    for (int way = 10; way < 80; ++way) go(world.T_map_lidar_at(way, false), erring(1.0, 0.0));
    go(Eigen::Isometry3d(Eigen::Translation3d(0.0, 400.0, 1.7)), erring(1.0, 0.0));
    go(world.T_map_lidar_at(120.0, false), erring(1.0, jump_m));
    for (int way = 121; way < 290; ++way) {
      const double up_m = way == 200 ? hump_m : way == 222 ? -hump_m : 0.0;
      go(world.T_map_lidar_at(way, false), erring(1.0 + scale_error, up_m));
    }
    closer.finish();
  }
};

TEST(MapAligner, OdometryThatIsOffInHeightMayDriftWhileClosuresGather) {
  const StreetWorld world(1);
  const SavedMap map = street_map(world, 0.0, 314.0, T_map_world, 1);
  for (const double scale_error : {0.0, 0.009}) {
    const DriveThatComesBack drive(world, 1.3, scale_error, 0.0);
    const MapAlignment alignment = drive.align(map);
    ASSERT_TRUE(alignment.is_recognized()) << alignment.in_words();
    EXPECT_GE(alignment.closures.size(), 9U) << scale_error << ": " << alignment.in_words();
    for (std::size_t k = 0; k < alignment.T_map_lidar.size(); ++k)
      // Poses on the way there hang on odometry.
      EXPECT_LT(error_m(alignment, drive, k), 0.3) << scale_error << ", " << k;
  }
}

TEST(MapAligner, OneThatDisagreesDoesNotMakeOthersForgotten) {
  const StreetWorld world(1);
  const SavedMap map = street_map(world, 0.0, 314.0, T_map_world, 1);
  const DriveThatComesBack drive(world, 1.3, 0.0, 0.8);
  const MapAlignment alignment = drive.align(map);
  ASSERT_TRUE(alignment.is_recognized()) << alignment.in_words();
  EXPECT_GE(alignment.closures.size(), 8U) << alignment.in_words();
  for (const MapClosure& closure : alignment.closures)
    EXPECT_LT(((T_map_world * drive.T_world_lidars[closure.scan]).inverse() * closure.T_map_lidar)
                  .translation()
                  .norm(),
              0.5)
        << closure.scan;
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
