#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <random>

#include "core/map/live_tile.hpp"
#include "core/map/static_map.hpp"

namespace stillmap {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

/// A map of what noise and poses put here and there.
class SettledVoxelsTest : public testing::Test {
 protected:
  SettledVoxelsTest() { map_.reset(1); }

  /// A wall across x, seen `scans` times with ranges that err by 2 cm.
  void see_wall(double x_m, int scans, SemanticClass label = SemanticClass::building) {
    std::normal_distribution<double> noise_m(0.0, 0.02);
    for (int k = 0; k < scans; ++k) {
      LabelledScan scan;
      for (double y = -3.0; y < 3.0; y += 0.07)
        for (double z = -1.0; z < 1.0; z += 0.07) add(scan, {x_m + noise_m(random_), y, z}, label);
      insert(std::move(scan));
    }
  }
  static void add(LabelledScan& scan, const Eigen::Vector3d& p, SemanticClass label) {
    scan.scan.points_lidar.push_back(p.cast<float>());
    scan.labels.classes.push_back(label);
    scan.labels.confidence.push_back(1.0F);
    scan.motion.push_back(Motion::stationary);
  }
  void insert(LabelledScan scan, bool is_thin = false) {
    scan.scan.stamp_ns = stamp_ns_ += second_ns / 10;
    const std::vector<std::uint8_t> thin(scan.scan.size(), is_thin ? 1 : 0);
    map_.insert(scan, Eigen::Isometry3d::Identity(), thin);
  }
  void begin_session() { map_.begin_session(); }
  void wait(std::int64_t duration_ns) { stamp_ns_ += duration_ns; }
  [[nodiscard]] std::size_t voxels() { return map_.view()->tiles.voxel_count(); }

  StaticMap map_{StaticMapConfig{}};
  std::mt19937 random_{3};
  std::int64_t stamp_ns_ = 0;
};

/// Noise reaches the voxels behind a wall one by one.
TEST_F(SettledVoxelsTest, AWallNearABorderDoesNotDoubleWithTheNextSession) {
  see_wall(8.16, 2);
  const std::size_t before = voxels();
  begin_session();
  see_wall(8.16, 20);
  EXPECT_LE(voxels(), before + before / 100);
}

TEST_F(SettledVoxelsTest, NorForALidarThatStandsThereForLong) {
  see_wall(8.16, 2);
  const std::size_t before = voxels();
  wait(60 * second_ns);
  see_wall(8.16, 20);
  EXPECT_LE(voxels(), before + before / 100);
}

TEST_F(SettledVoxelsTest, WhatIsSeenForTheFirstTimeHasAllItsVoxels) {
  see_wall(8.16, 2);
  const std::size_t before = voxels();
  see_wall(8.16, 20);
  EXPECT_GT(voxels(), before + before / 20);
}

TEST_F(SettledVoxelsTest, AnotherWallIsShownBesideTheFirst) {
  see_wall(8.1, 2);
  const std::size_t before = voxels();
  begin_session();
  see_wall(8.30, 2);
  EXPECT_EQ(voxels(), 2 * before);
}

TEST_F(SettledVoxelsTest, WhatLabelsTellApartAndThinThingsAreShownWhereverTheyAre) {
  see_wall(8.1, 3);
  const std::size_t before = voxels();
  begin_session();
  const auto see = [&](double y, SemanticClass label, bool is_thin) {
    LabelledScan scan;
    add(scan, {8.21, y, 0.1}, label);
    insert(std::move(scan), is_thin);
    return voxels() - before;
  };
  EXPECT_EQ(see(0.1, SemanticClass::building, false), 0U);
  EXPECT_EQ(see(0.5, SemanticClass::pole, false), 1U);
  EXPECT_EQ(see(0.9, SemanticClass::building, true), 2U);
}

TEST_F(SettledVoxelsTest, ATileThatACorrectionFillsIsAsOneThatStayed) {
  see_wall(8.16, 2);
  const std::size_t before = voxels();
  // By a tile.
  const Eigen::Isometry3d T_new_old(Eigen::Translation3d(20.0, 0.0, 0.0));
  map_.correct(MapCorrection({{0, Eigen::Vector3d::Zero(), T_new_old}}));
  ASSERT_EQ(voxels(), before);
  begin_session();
  see_wall(28.16, 20);
  EXPECT_LE(voxels(), before + before / 100);
}

TEST_F(SettledVoxelsTest, SoIsOneWhereOnlyWhatWasRestoredIsKnown) {
  const VoxelGrid grid(0.2, 20.0);
  const VisibilityRule rule;
  const VoxelIndex index{7, 8, 1};
  TileEvidence evidence;
  evidence.excluded.push_back({index, SemanticClass::car, true, 5});
  const TileRecord record{nullptr, std::make_shared<const TileEvidence>(evidence)};
  ScanStamps stamps;
  LiveTile tile({}, record, grid, stamps);
  const Eigen::AlignedBox3d everywhere(Eigen::Vector3d::Constant(-1e3),
                                       Eigen::Vector3d::Constant(1e3));
  ASSERT_EQ(tile.restore(RemovalReason::moving, everywhere, rule, stamps), 1U);
  const SettledVoxels settled{stamps, second_ns, rule};
  TilePoint point{.voxel_key = voxel_key(index), .offset = {128, 128, 128}, .confidence = 1.0F};
  for (int scan = 0; scan < 3; ++scan)
    tile.insert(std::array{point}, stamps.add((2 + scan) * second_ns), &settled);
  point.voxel_key = voxel_key({8, 8, 1});
  point.offset[0] = 10;
  tile.insert(std::array{point}, stamps.add(5 * second_ns), &settled);
  ASSERT_TRUE(tile.publish(1, rule, stamps));
  EXPECT_EQ(tile.published()->voxels.size(), 1U);
}

/// Neither what one scan alone hit, nor what is hidden.
TEST_F(SettledVoxelsTest, OnlySurfacesTakePointsThatAreBesideThem) {
  LabelledScan once;
  add(once, {8.19, 0.1, 0.1}, SemanticClass::building);
  insert(std::move(once));
  LabelledScan parked;
  add(parked, {8.19, 1.1, 0.1}, SemanticClass::car);
  for (int k = 0; k < 3; ++k) insert(parked);
  begin_session();
  const std::size_t before = voxels();
  LabelledScan beside;
  add(beside, {8.21, 0.1, 0.1}, SemanticClass::building);
  add(beside, {8.21, 1.1, 0.1}, SemanticClass::unlabeled);
  insert(std::move(beside));
  EXPECT_EQ(voxels(), before + 2);
}

}  // namespace
}  // namespace stillmap
