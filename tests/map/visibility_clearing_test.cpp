#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "core/lidar/range_image_view.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3f;
using enum SemanticClass;
using test::add_point;

constexpr double degree = 0.017453292519943295;

/// Rays of a 64-beam lidar ahead, each as far as `range_of` says.
template <typename RangeOf>
LabelledScan looking_ahead(std::int64_t stamp_ns, RangeOf range_of) {
  LabelledScan scan;
  scan.scan.stamp_ns = stamp_ns;
  for (int ring = 0; ring < 30; ++ring) {
    const double elevation = -10.0 + 0.4 * ring;
    for (int column = 0; column < 100; ++column) {
      const double azimuth = -10.0 + 0.2 * column;
      const double e = elevation * degree, a = azimuth * degree;
      const auto [range_m, label, motion] = range_of(azimuth, elevation);
      const Vector3f direction(static_cast<float>(std::cos(e) * std::cos(a)),
                               static_cast<float>(std::cos(e) * std::sin(a)),
                               static_cast<float>(std::sin(e)));
      add_point(scan, static_cast<float>(range_m) * direction, label, motion);
    }
  }
  return scan;
}

struct Seen {
  double range_m;
  SemanticClass label;
  Motion motion = Motion::stationary;
};

Seen wall(double, double) { return {20.0, building}; }
/// Something 10 m ahead, two metres wide, taken for a fence.
Seen ghost(double azimuth, double elevation) {
  return std::abs(azimuth) < 6.0 && elevation < 0.0 ? Seen{10.0, fence} : wall(azimuth, elevation);
}
/// One column of rays in a hundred.
Seen pole_before_wall(double azimuth, double elevation) {
  return std::abs(azimuth) < 0.15 ? Seen{12.0, pole} : wall(azimuth, elevation);
}
/// The same, and the labels do not say what it is.
Seen unknown_ghost(double azimuth, double elevation) {
  Seen seen = ghost(azimuth, elevation);
  if (seen.label == fence) seen.label = unlabeled;
  return seen;
}
/// Bars 10 m ahead, as far from each other as two rays are.
Seen fence_before_wall(double azimuth, double elevation) {
  const bool is_bar = std::lround((azimuth + 10.0) / 0.2) % 2 == 0;
  return is_bar ? Seen{10.0, unlabeled} : wall(azimuth, elevation);
}
Seen passing_car(double azimuth, double elevation) {
  Seen seen = ghost(azimuth, elevation);
  if (seen.label == fence) seen = {10.0, car, Motion::highly_dynamic};
  return seen;
}
Seen parked_car(double azimuth, double elevation) {
  Seen seen = passing_car(azimuth, elevation);
  if (seen.label == car) seen.motion = Motion::semi_static;
  return seen;
}

class VisibilityClearing : public testing::Test {
 protected:
  template <typename World>
  void see(World world, int scans) {
    for (int i = 0; i < scans; ++i) {
      const LabelledScan scan = looking_ahead(++stamp_ns_, world);
      map_.insert(scan, Isometry3d::Identity());
      map_.clear_seen_through(RangeImageView(scan.scan, {}, hdl_64e(), Isometry3d::Identity()),
                              stamp_ns_);
    }
  }
  /// As the mapper does: only where it is due. Returns in which of the scans.
  template <typename World>
  std::vector<int> see_when_due(World world, int scans) {
    std::vector<int> due;
    for (int i = 1; i <= scans; ++i) {
      const LabelledScan scan = looking_ahead(++stamp_ns_, world);
      map_.insert(scan, Isometry3d::Identity());
      const Clearing what = map_.clearing_due(Eigen::Vector3f::Zero());
      if (what == Clearing::all) due.push_back(i);
      map_.clear_seen_through(RangeImageView(scan.scan, {}, hdl_64e(), Isometry3d::Identity()),
                              stamp_ns_, what);
    }
    return due;
  }
  /// As the mapper does, from a lidar that goes ahead by so much from scan to scan; the world goes
  /// with it.
  template <typename World>
  void drive_by(World world, int scans, double step_m) {
    for (int i = 1; i <= scans; ++i) {
      const Isometry3d T_map_lidar(Eigen::Translation3d(step_m * i, 0.0, 0.0));
      const LabelledScan scan = looking_ahead(++stamp_ns_, world);
      map_.insert(scan, T_map_lidar);
      const Clearing what = map_.clearing_due(T_map_lidar.translation().cast<float>());
      map_.clear_seen_through(RangeImageView(scan.scan, {}, hdl_64e(), T_map_lidar), stamp_ns_,
                              what);
    }
  }
  [[nodiscard]] int shown(SemanticClass label) {
    int count = 0;
    for (const auto& tile : map_.view()->tiles) {
      count += static_cast<int>(std::ranges::count_if(
          tile->voxels, [label](const Voxel& voxel) { return voxel.evidence.winner() == label; }));
    }
    return count;
  }
  [[nodiscard]] int removed(RemovalReason reason) const {
    const std::vector<RemovedVoxel> all =
        map_.removed(test::everywhere(), map_.tiles_in(test::everywhere())).voxels;
    return static_cast<int>(std::ranges::count(all, reason, &RemovedVoxel::reason));
  }

  StaticMap map_{StaticMapConfig{}};
  std::int64_t stamp_ns_ = 0;
};

TEST_F(VisibilityClearing, WhatRaysKeepPassingThroughLeavesTheView) {
  see(ghost, 2);
  const int before = shown(fence);
  ASSERT_GT(before, 50);
  see(wall, 2);
  EXPECT_EQ(shown(fence), before);
  see(wall, 2);
  EXPECT_LT(shown(fence), before / 10);
  EXPECT_GT(removed(RemovalReason::seen_through), before * 9 / 10);
  EXPECT_GT(shown(building), 100);
}

TEST_F(VisibilityClearing, WhatComesToStandThereComesIntoViewAgain) {
  see(ghost, 2);
  const int before = shown(fence);
  see(wall, 20);
  ASSERT_LT(shown(fence), before / 10);
  see(ghost, 20);
  EXPECT_LT(shown(fence), before / 10) << "it may be a vehicle that waits";
  see(ghost, 20);
  EXPECT_GE(shown(fence), before);
}

TEST_F(VisibilityClearing, WithoutAClassOneRayIsEnough) {
  see(unknown_ghost, 2);
  const int before = shown(unlabeled);
  ASSERT_GT(before, 50);
  see(wall, 1);
  EXPECT_LT(shown(unlabeled), before / 10);
}

TEST_F(VisibilityClearing, WhatComesIntoFreeSpaceIsNotShown) {
  see(wall, 10);
  see(unknown_ghost, 10);
  EXPECT_LT(shown(unlabeled), 5);
  EXPECT_GT(removed(RemovalReason::seen_through), 50);
}

TEST_F(VisibilityClearing, WhatComesIntoFreeSpaceAndStaysIsShownInTheEnd) {
  see(wall, 10);
  see(unknown_ghost, 100);
  EXPECT_GT(shown(unlabeled), 50);
}

TEST_F(VisibilityClearing, IsDueWithEachOfTheFirstScansOfANewMap) {
  const std::vector<int> first = see_when_due(wall, 24);
  const std::vector<int> expected{1,  2,  3,  4,  5,  6,  7,  8,  9, 10,
                                  11, 12, 13, 14, 15, 16, 18, 21, 24};
  EXPECT_EQ(first, expected);
  map_.reset(2);
  EXPECT_EQ(see_when_due(wall, 24), expected);
  map_.resume(*map_.view(), {});
  EXPECT_EQ(see_when_due(wall, 8), (std::vector{3, 6})) << "a run that goes on";
  map_.reset(3);
  map_.begin_session();
  EXPECT_EQ(see_when_due(wall, 8), (std::vector{3, 6})) << "what was there is known";
  StaticMapConfig config;
  config.free_space_history = 0;
  map_ = StaticMap(config);
  EXPECT_EQ(see_when_due(wall, 8), (std::vector{3, 6}));
  config.free_space_history = 2;
  map_ = StaticMap(config);
  EXPECT_EQ(see_when_due(wall, 8), (std::vector{1, 2, 3, 6}));
}

TEST_F(VisibilityClearing, WhatComesIntoFreeSpaceIsNotShownFromTheSecondScanOn) {
  see_when_due(wall, 1);
  see_when_due(unknown_ghost, 1);
  EXPECT_LT(shown(unlabeled), 5);
  EXPECT_GT(removed(RemovalReason::seen_through), 50);
}

TEST_F(VisibilityClearing, WithoutAHistoryOnlyLaterScansClear) {
  StaticMapConfig config;
  config.free_space_history = 0;
  map_ = StaticMap(config);
  see(wall, 10);
  see(unknown_ghost, 10);
  EXPECT_GT(shown(unlabeled), 50);
}

TEST_F(VisibilityClearing, AFenceOfWhichEverySecondRayMissesStays) {
  see(fence_before_wall, 10);
  const int before = shown(unlabeled);
  ASSERT_GT(before, 50);
  see(fence_before_wall, 50);
  EXPECT_GE(shown(unlabeled), before);
  EXPECT_EQ(removed(RemovalReason::seen_through), 0);
}

TEST_F(VisibilityClearing, ThinThingsStay) {
  see(pole_before_wall, 3);
  const int before = shown(pole);
  ASSERT_GT(before, 5);
  see(pole_before_wall, 100);
  EXPECT_GE(shown(pole), before);
  EXPECT_EQ(removed(RemovalReason::seen_through), 0);
}

TEST_F(VisibilityClearing, RemovedThingsAreRememberedWithTheirReason) {
  see(passing_car, 1);
  const int moving = removed(RemovalReason::moving);
  EXPECT_GT(moving, 50);
  see(parked_car, 3);
  EXPECT_EQ(removed(RemovalReason::moving), moving);
  EXPECT_EQ(shown(car), 0);
}

TEST_F(VisibilityClearing, RemovedThingsCanBeShownAgain) {
  see(parked_car, 3);
  const int parked = removed(RemovalReason::semi_static);
  ASSERT_GT(parked, 50);
  const Eigen::AlignedBox3d left(Eigen::Vector3d(0, 0, -10), Eigen::Vector3d(30, 30, 10));
  const auto restored =
      map_.restore_removed(RemovalReason::semi_static, left, map_.tiles_in(left)).count;
  EXPECT_GT(restored, 10U);
  EXPECT_EQ(shown(car), static_cast<int>(restored));
  EXPECT_EQ(removed(RemovalReason::semi_static), parked - static_cast<int>(restored));
  see(wall, 30);
  EXPECT_EQ(shown(car), static_cast<int>(restored));
}

TEST_F(VisibilityClearing, AStoredMapKeepsItsWeight) {
  see(ghost, 30);
  const auto stored = map_.view();
  map_ = StaticMap(StaticMapConfig{});
  map_.resume(*stored);
  const int before = shown(fence);
  ASSERT_GT(before, 50);
  see(wall, 5);
  EXPECT_EQ(shown(fence), before);
}

TEST_F(VisibilityClearing, WhatIsGoneInAnotherSessionGoesHoweverOftenItWasSeen) {
  see(ghost, 300);
  const int before = shown(fence);
  ASSERT_GT(before, 50);
  see(wall, 10);
  ASSERT_EQ(shown(fence), before) << "within a session it has its weight";
  map_.begin_session(20);
  EXPECT_EQ(shown(fence), before);
  see(wall, 10);
  EXPECT_LT(shown(fence), before / 10);
  EXPECT_GT(shown(building), 100);
}

/// Four scans have its place in sight: too few for what each third of them tells.
TEST_F(VisibilityClearing, WhatIsGoneInAnotherSessionGoesWhereTheLidarDrivesBy) {
  see(unknown_ghost, 300);
  const int before = shown(unlabeled);
  ASSERT_GT(before, 50);
  map_.begin_session(20);
  drive_by(wall, 4, 1.2);
  // What is beside it leaves the lidar's view.
  EXPECT_LT(shown(unlabeled), before / 2);
  EXPECT_GT(shown(building), 100);
}

TEST_F(VisibilityClearing, ALidarThatHardlyMovesOnTellsNoMoreThanEachThirdScan) {
  see(unknown_ghost, 300);
  const int before = shown(unlabeled);
  map_.begin_session(20);
  drive_by(wall, 4, 0.1);
  EXPECT_EQ(shown(unlabeled), before);
}

TEST_F(VisibilityClearing, WhatASessionHasHitIsClearedByEachThirdScanAlone) {
  see(wall, 2);
  map_.begin_session(20);
  drive_by(unknown_ghost, 4, 0.0);
  const int before = shown(unlabeled);
  ASSERT_GT(before, 50);
  drive_by(wall, 2, 1.2);
  EXPECT_EQ(shown(unlabeled), before);
}

TEST_F(VisibilityClearing, WhatASessionSawKeepsItsWeightWhereItsTileWasEvicted) {
  const std::unique_ptr<MapStore> store = open_scratch_map();
  map_.reset(7);
  map_.use_tile_store(store->tile_store());
  see(ghost, 2);
  map_.begin_session(20);
  see(ghost, 300);
  const int before = shown(fence);
  const MapCheckpoint checkpoint = map_.checkpoint();
  store->save(to_saved_map(checkpoint));
  map_.checkpoint_stored(checkpoint.step);
  map_.evict({2000.0, 0.0, 0.0}, 8);
  ASSERT_EQ(map_.memory_use().resident_tiles, 0U);
  see(wall, 10);
  EXPECT_EQ(shown(fence), before);
}

TEST_F(VisibilityClearing, WhatIsThereInAnotherSessionAppearsHoweverOftenItWasNot) {
  see(ghost, 2);
  const int before = shown(fence);
  see(wall, 300);
  ASSERT_LT(shown(fence), before / 10);
  map_.begin_session(20);
  EXPECT_LT(shown(fence), before / 10);
  see(ghost, 25);
  EXPECT_GE(shown(fence), before * 9 / 10);
}

TEST_F(VisibilityClearing, TilesThatNoScanOfASessionReachesStay) {
  see(ghost, 300);
  const MapCheckpoint first = map_.checkpoint();
  map_.checkpoint_stored(first.step);
  map_.begin_session(20);
  EXPECT_TRUE(map_.checkpoint().records.empty());
  EXPECT_EQ(map_.view()->version, first.view->version);
}

TEST_F(VisibilityClearing, OffItLeavesEverything) {
  StaticMapConfig config;
  config.clearing_range_m = 0.0;
  map_ = StaticMap(config);
  see(ghost, 2);
  const int before = shown(fence);
  see(wall, 30);
  EXPECT_EQ(shown(fence), before);
}

}  // namespace
}  // namespace stillmap
