#include "core/session/map_merge.hpp"

#include <gtest/gtest.h>

#include <set>
#include <tuple>

#include "tests/session/street_maps.hpp"

namespace stillmap {
namespace {

const Eigen::Isometry3d T_merged_world =
    Eigen::Translation3d(30.0, -12.0, 2.0) * Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ());
const Eigen::Isometry3d T_other_world =
    Eigen::Translation3d(-7.0, 40.0, -1.0) * Eigen::AngleAxisd(-1.9, Eigen::Vector3d::UnitZ());

/// A map of one wall, seen from the origin of its frame.
SavedMap wall_map(double x_m, SemanticClass label, std::int64_t stamp_ns) {
  StaticMap map{StaticMapConfig{}};
  map.reset(1);
  LabelledScan scan;
  scan.scan.stamp_ns = stamp_ns;
  for (double y = -3.0; y < 3.0; y += 0.1) {
    for (double z = 0.0; z < 2.0; z += 0.1) {
      scan.scan.points_lidar.emplace_back(static_cast<float>(x_m), static_cast<float>(y),
                                          static_cast<float>(z));
      scan.labels.classes.push_back(label);
      scan.labels.confidence.push_back(1.0F);
      scan.motion.push_back(Motion::stationary);
    }
  }
  map.insert(scan, Eigen::Isometry3d::Identity());
  SavedMap saved = to_saved_map(map.checkpoint(CheckpointScope::everything));
  saved.trajectory.push_back({stamp_ns, Eigen::Isometry3d::Identity()});
  return saved;
}

std::uint64_t points_of(const SavedMap& map) {
  std::uint64_t points = 0;
  for (const auto& tile : map.view.tiles)
    for (const Voxel& voxel : tile->voxels) points += voxel.point_count;
  return points;
}

TEST(MapMerge, VoxelsAtOnePlaceAreOne) {
  const SavedMap map = wall_map(8.05, SemanticClass::building, 10);
  const SavedMap other = wall_map(5.05, SemanticClass::building, 4);
  const Eigen::Isometry3d T_map_other(Eigen::Translation3d(3.0, 0.0, 0.0));
  const SavedMap merged = merged_map(map, other, {T_map_other}, 7);
  ASSERT_EQ(merged.view.tiles.size(), map.view.tiles.size());
  EXPECT_EQ(points_of(merged), 2 * points_of(map));
  for (const auto& tile : merged.view.tiles) {
    const auto before = map.view.tiles.find(tile->info.id);
    EXPECT_EQ(tile->voxels.size(), before->voxels.size());
    EXPECT_GT(tile->info.revision, before->info.revision);
    for (const Voxel& voxel : tile->voxels) {
      EXPECT_NEAR(voxel.mean_map.x(), 8.05, 0.01);
      EXPECT_EQ(voxel.evidence.winner(), SemanticClass::building);
      EXPECT_EQ(voxel.first_seen_ns, 10);
      EXPECT_EQ(voxel.last_seen_ns, 11);
    }
  }
  ASSERT_EQ(merged.trajectory.size(), 2U);
  EXPECT_EQ(merged.trajectory[1].stamp_ns, 11);
  EXPECT_TRUE(merged.trajectory[1].T_map_lidar.isApprox(T_map_other));
  EXPECT_TRUE(merged.is_partial);
  EXPECT_EQ(merged.view.version, map.view.version + 1);
}

TEST(MapMerge, WhatOneOfThemAloneHasStays) {
  const SavedMap map = wall_map(8.05, SemanticClass::building, 10);
  const SavedMap other = wall_map(9.05, SemanticClass::fence, 20);
  const SavedMap merged = merged_map(map, other, {Eigen::Isometry3d::Identity()}, 0);
  EXPECT_EQ(points_of(merged), points_of(map) + points_of(other));
  std::set<SemanticClass> classes;
  for (const auto& tile : merged.view.tiles)
    for (const Voxel& voxel : tile->voxels) classes.insert(voxel.evidence.winner());
  EXPECT_EQ(classes, (std::set{SemanticClass::building, SemanticClass::fence}));
}

TEST(MapMerge, TheRestOfAMoverInOneMapSaysNothingAgainstWhatTheOtherSaw) {
  const auto hidden = [](SavedMap map) {
    for (const auto& tile : map.view.tiles) {
      auto evidence = std::make_shared<TileEvidence>();
      evidence->id = tile->info.id;
      evidence->hidden = tile->voxels;
      evidence->hidden_states.assign(
          tile->voxels.size(), {{.hits = 1, .misses = VoxelHistory::misses_of_rest}, std::nullopt});
      map.tile_evidence[tile->info.id] = std::move(evidence);
    }
    map.view.tiles = {};
    return map;
  };
  const SavedMap wall = wall_map(8.05, SemanticClass::building, 10);
  const SavedMap rest = hidden(wall_map(8.05, SemanticClass::building, 10));
  const std::vector here{Eigen::Isometry3d::Identity()};
  EXPECT_EQ(points_of(merged_map(wall, rest, here, 0)), 2 * points_of(wall));
  EXPECT_EQ(points_of(merged_map(rest, wall, here, 0)), 2 * points_of(wall));
  EXPECT_EQ(points_of(merged_map(rest, rest, here, 0)), 0U);
}

TEST(MapMerge, ShowsVoxelsByTheRuleThatItIsGiven) {
  const auto missed = [](SavedMap map) {
    for (const auto& tile : map.view.tiles) {
      auto evidence = std::make_shared<TileEvidence>();
      evidence->id = tile->info.id;
      evidence->shown.assign(tile->voxels.size(), {.hits = 1, .misses = 5, .was_shown = true});
      map.tile_evidence[tile->info.id] = std::move(evidence);
    }
    return map;
  };
  const SavedMap map = missed(wall_map(8.05, SemanticClass::building, 10));
  const SavedMap other = missed(wall_map(9.05, SemanticClass::building, 20));
  const std::vector here{Eigen::Isometry3d::Identity()};
  EXPECT_EQ(points_of(merged_map(map, other, here, 0)), 0U);
  StaticMapConfig rule;
  rule.misses_to_clear = 20;
  EXPECT_EQ(points_of(merged_map(map, other, here, 0, rule)), points_of(map) + points_of(other));
}

TEST(MapMerge, APathOfTwoRunsWhoseClockBeganAnewMovesEachVoxelByItsOwnRun) {
  const SavedMap map = wall_map(8.05, SemanticClass::building, 100);
  SavedMap other = wall_map(5.05, SemanticClass::building, 4);
  other.trajectory = {{50, Eigen::Isometry3d::Identity()},
                      {60, Eigen::Isometry3d::Identity()},
                      {4, Eigen::Isometry3d::Identity()}};
  const Eigen::Isometry3d T_map_first(Eigen::Translation3d(90.0, 0.0, 0.0));
  const Eigen::Isometry3d T_map_second(Eigen::Translation3d(3.0, 0.0, 0.0));
  const SavedMap merged = merged_map(map, other, {T_map_first, T_map_first, T_map_second}, 200);
  EXPECT_EQ(points_of(merged), 2 * points_of(map));
  for (const auto& tile : merged.view.tiles)
    for (const Voxel& voxel : tile->voxels) EXPECT_NEAR(voxel.mean_map.x(), 8.05, 0.01);
}

TEST(MapMerge, ViewsDoNotSeeThroughWalls) {
  std::vector<LabelledPoint> points;
  for (float y = -6.0F; y < 6.0F; y += 0.2F) {
    for (float z = -2.0F; z < 4.0F; z += 0.2F) {
      points.push_back({{10.0F, y, z}, SemanticClass::building});
      points.push_back({{20.0F, 0.5F * y, 0.5F * z}, SemanticClass::fence});
      points.push_back({{-20.0F, y, z}, SemanticClass::vegetation});
    }
  }
  points.push_back({{60.0F, 30.0F, 0.0F}, SemanticClass::pole});
  const LabelledScan view = view_of_map(points, Eigen::Isometry3d::Identity(), 0.2);
  std::size_t walls = 0, hidden = 0, behind = 0;
  for (std::size_t i = 0; i < view.scan.size(); ++i) {
    walls += view.label(i) == SemanticClass::building ? 1 : 0;
    hidden += view.label(i) == SemanticClass::fence ? 1 : 0;
    behind += view.label(i) == SemanticClass::vegetation ? 1 : 0;
    EXPECT_NE(view.label(i), SemanticClass::pole) << "too far";
  }
  EXPECT_EQ(walls, points.size() / 3);
  EXPECT_EQ(behind, points.size() / 3);
  EXPECT_LT(hidden, points.size() / 3 / 50);
}

TEST(MapMerge, AMapMadeApartIsFoundAndPutInPlace) {
  const StreetWorld world(1);
  const SavedMap map = street_map(world, 0.0, 150.0, T_merged_world, 1);
  const SavedMap other = street_map(world, 60.0, 230.0, T_other_world, 1000);
  const MapAlignment alignment =
      align_maps(index_of(map), *index_of(other), other.trajectory, other.view.voxel_size_m);
  ASSERT_TRUE(alignment.is_recognized()) << alignment.in_words();
  const Eigen::Isometry3d T_map_other = T_merged_world * T_other_world.inverse();
  for (std::size_t k = 0; k < other.trajectory.size(); ++k) {
    const Eigen::Isometry3d truth = T_map_other * other.trajectory[k].T_map_lidar;
    EXPECT_LT((truth.inverse() * alignment.T_map_lidar[k]).translation().norm(),
              k < 80 ? 0.15 : 0.6)
        << k;
  }
}

TEST(MapMerge, AMapOfAnotherStreetIsNotFound) {
  const SavedMap map = street_map(StreetWorld(1), 0.0, 150.0, T_merged_world, 1);
  const SavedMap other = street_map(StreetWorld(4), 0.0, 150.0, T_other_world, 1000);
  EXPECT_FALSE(
      align_maps(index_of(map), *index_of(other), other.trajectory, other.view.voxel_size_m)
          .is_recognized());
}

}  // namespace
}  // namespace stillmap
