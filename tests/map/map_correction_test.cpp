#include "core/map/map_correction.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "core/map/static_map.hpp"
#include "core/map/tile_evidence.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;
using Eigen::Vector3f;
using enum SemanticClass;

constexpr std::int64_t second_ns = 1'000'000'000;

StaticMapConfig config() {
  StaticMapConfig config;
  config.clearing_range_m = 0.0;
  return config;
}

/// A wall of 40 m by 4 m, seen in steps of 7 cm.
LabelledScan wall(double y_m, SemanticClass label = building) {
  LabelledScan scan;
  for (float x = 0.0F; x < 40.0F; x += 0.07F)
    for (float z = 0.0F; z < 4.0F; z += 0.07F)
      test::add_point(scan, {x, static_cast<float>(y_m), z}, label);
  return scan;
}

LabelledScan at(std::int64_t seconds, LabelledScan scan) {
  scan.scan.stamp_ns = seconds * second_ns;
  return scan;
}

MapCorrection correction(std::int64_t begin_s, const Isometry3d& T_new_old) {
  return MapCorrection({{begin_s * second_ns, Vector3d::Zero(), T_new_old}});
}

std::size_t voxels(const MapSnapshot& view) { return view.tiles.voxel_count(); }

std::vector<Vector3f> means(const MapSnapshot& view) {
  std::vector<Vector3f> all;
  for (const auto& tile : view.tiles)
    for (const Voxel& voxel : tile->voxels) all.push_back(voxel.mean_map);
  return all;
}

TEST(MapCorrection, IsThatOfTheLastPoseBeforeATime) {
  const Isometry3d T_1(Translation3d(1, 0, 0));
  const Isometry3d T_2(Translation3d(2, 0, 0));
  const MapCorrection two({{10, Vector3d::Zero(), T_1}, {20, Vector3d::Zero(), T_2}});
  EXPECT_EQ(two.at(9), nullptr);
  EXPECT_EQ(two.at(10)->translation().x(), 1.0);
  EXPECT_EQ(two.at(19)->translation().x(), 1.0);
  EXPECT_EQ(two.at(1000)->translation().x(), 2.0);
}

TEST(MapCorrection, TwoAreOneAfterTheOther) {
  const Isometry3d T_first = Translation3d(1, 0, 0) * Eigen::AngleAxisd(0.1, Vector3d::UnitZ());
  const Isometry3d T_second = Translation3d(0, 2, 0) * Eigen::AngleAxisd(0.2, Vector3d::UnitX());
  const Vector3d there(5, 6, 7);
  const MapCorrection first({{10, there, T_first}});
  const MapCorrection second({{10, T_first * there, T_second}, {20, there, T_second}});
  const MapCorrection both = combined(first, second);
  ASSERT_EQ(both.poses().size(), 2U);
  EXPECT_TRUE(both.at(10)->isApprox(T_second * T_first));
  EXPECT_TRUE(both.at(30)->isApprox(T_second * T_first));
  EXPECT_TRUE(both.poses().front().position_map.isApprox(there));
}

TEST(CorrectedStaticMap, WhatWasSeenThenMovesAndNothingElse) {
  StaticMap map(config());
  map.insert(at(1, wall(10.05)), Isometry3d::Identity());
  const auto before = map.view();
  map.insert(at(5, wall(20.05)), Isometry3d::Identity());
  const auto both = map.view();
  const auto corrected = map.correct(correction(3, Isometry3d(Translation3d(0.43, 0.5, -0.21))));
  const auto after = map.view();
  ASSERT_TRUE(corrected);
  EXPECT_EQ(corrected->moved_voxels, voxels(*both) - voxels(*before));
  EXPECT_GT(after->version, both->version);
  EXPECT_EQ(after->map_id, both->map_id);
  std::size_t first = 0;
  for (const Vector3f& mean : means(*after)) {
    if (mean.y() < 15.0F) {
      EXPECT_NEAR(mean.y(), 10.05, 1e-3);
      ++first;
      continue;
    }
    EXPECT_NEAR(mean.y(), 20.55, 2e-3);
    EXPECT_GT(mean.x(), 0.42F);
    EXPECT_LT(mean.z(), 3.8F);
  }
  EXPECT_EQ(first, voxels(*before));
}

TEST(CorrectedStaticMap, AWallHasNoHolesAfterwards) {
  for (const Vector3d& shift :
       {Vector3d(0.13, 0.0, 0.07), Vector3d(0.31, 0.11, 0.3), Vector3d(0.0, 1.0, 0.1)}) {
    StaticMap map(config());
    // Few points a voxel: their means lie anywhere in it.
    LabelledScan sparse;
    std::uint32_t random = 1;
    for (const Vector3f& p : wall(10.05).scan.points_lidar) {
      random = random * 1664525U + 1013904223U;
      if (random >> 28 < 3) test::add_point(sparse, p, building);
    }
    map.insert(at(1, sparse), Isometry3d::Identity());
    const std::size_t before = voxels(*map.view());
    ASSERT_TRUE(map.correct(correction(0, Isometry3d(Eigen::Translation3d(shift)))));
    const std::size_t after = voxels(*map.view());
    EXPECT_GT(static_cast<double>(after), 0.98 * static_cast<double>(before)) << shift.transpose();
    EXPECT_LE(after, before);
  }
}

TEST(CorrectedStaticMap, AWallThatStoodTwiceStandsOnce) {
  StaticMap once(config());
  once.insert(at(1, wall(10.05)), Isometry3d::Identity());
  const std::size_t single = voxels(*once.view());
  StaticMap map(config());
  map.insert(at(1, wall(10.05)), Isometry3d::Identity());
  map.insert(at(5, wall(10.05, fence)), Isometry3d(Translation3d(0.0, 0.6, 0.0)));
  map.insert(at(6, wall(10.05, fence)), Isometry3d(Translation3d(0.0, 0.6, 0.0)));
  EXPECT_EQ(voxels(*map.view()), 2 * single);
  ASSERT_TRUE(map.correct(correction(4, Isometry3d(Translation3d(0.0, -0.6, 0.0)))));
  const auto view = map.view();
  EXPECT_NEAR(static_cast<double>(voxels(*view)), static_cast<double>(single),
              0.01 * static_cast<double>(single));
  const ClassEvidence evidence = map.evidence_at({5.03, 10.05, 1.03});
  EXPECT_EQ(evidence.winner(), fence) << "two scans outvote one";
  EXPECT_NEAR(evidence.share(), 2.0 / 3.0, 0.05) << "and the one is not forgotten";
  for (const auto& tile : view->tiles) {
    for (const Voxel& voxel : tile->voxels) {
      EXPECT_EQ(voxel.first_seen_ns, 1 * second_ns);
      EXPECT_EQ(voxel.last_seen_ns, 6 * second_ns);
    }
  }
}

TEST(CorrectedStaticMap, WhereThePosesStayNothingMoves) {
  StaticMap map(config());
  map.insert(at(1, wall(10.05)), Isometry3d::Identity());
  const auto before = map.view();
  const auto corrected = map.correct(correction(0, Isometry3d::Identity()));
  ASSERT_TRUE(corrected);
  EXPECT_EQ(corrected->moved_voxels, 0U);
  EXPECT_EQ(map.view(), before);
}

// What stayed behind by less than half a voxel each time would be left.
TEST(CorrectedStaticMap, ManySmallOnesAddUp) {
  StaticMap map(config());
  map.insert(at(1, wall(10.05)), Isometry3d::Identity());
  const std::size_t before = voxels(*map.view());
  for (int k = 0; k < 10; ++k)
    ASSERT_TRUE(map.correct(correction(0, Isometry3d(Translation3d(0.0, 0.08, 0.0)))));
  for (const Vector3f& mean : means(*map.view())) EXPECT_NEAR(mean.y(), 10.85, 0.01);
  EXPECT_GT(static_cast<double>(voxels(*map.view())), 0.98 * static_cast<double>(before));
}

TEST(CorrectedStaticMap, PlacesOfObjectsMoveAlong) {
  StaticMap map(config());
  LabelledScan scan;
  test::add_point(scan, {5.1F, 5.1F, 1.1F}, car, Motion::highly_dynamic);
  map.insert(at(2, scan), Isometry3d::Identity());
  const auto places = [&map] {
    const auto tiles = map.tiles_in(test::everywhere());
    return map.removed(test::everywhere(), tiles).voxels;
  };
  ASSERT_EQ(places().size(), 1U);
  ASSERT_TRUE(map.correct(correction(1, Isometry3d(Translation3d(20.0, 0.0, 0.0)))));
  const auto moved = places();
  ASSERT_EQ(moved.size(), 1U);
  EXPECT_NEAR(moved[0].position_map.x(), 25.1F, 1e-3F);
  EXPECT_EQ(moved[0].reason, RemovalReason::moving);
  // Places are voxels, and have no rest of a move: many small ones add up all the same.
  for (int k = 0; k < 20; ++k)
    ASSERT_TRUE(map.correct(correction(1, Isometry3d(Translation3d(0.0, 0.08, -0.03)))));
  ASSERT_EQ(places().size(), 1U);
  EXPECT_NEAR(places()[0].position_map.y(), 6.7F, 0.31F);
  EXPECT_NEAR(places()[0].position_map.z(), 0.5F, 0.31F);
}

/// Keeps what checkpoints hold.
class Store : public TileStore {
 public:
  void keep(const MapCheckpoint& checkpoint) {
    for (const auto& [id, record] : checkpoint.records) records_[id] = record;
  }
  void forget(TileId id) { records_.erase(id); }
  TileRecord load(TileId id) override {
    const auto known = records_.find(id);
    if (known == records_.end()) throw std::runtime_error("the disk is gone");
    return known->second;
  }

 private:
  std::map<TileId, TileRecord> records_;
};

class EvictedMap : public testing::Test {
 protected:
  EvictedMap() : store_(std::make_shared<Store>()), map_(config()) {
    map_.use_tile_store(store_);
    map_.insert(at(1, wall(10.05)), Isometry3d::Identity());
    const MapCheckpoint checkpoint = map_.checkpoint(CheckpointScope::everything);
    before_ = checkpoint.view;
    store_->keep(checkpoint);
    map_.checkpoint_stored(checkpoint.step);
    map_.evict({2000.0, 0.0, 0.0}, 8);
  }
  std::shared_ptr<Store> store_;
  StaticMap map_;
  std::shared_ptr<const MapSnapshot> before_;
  MapCorrection correction_{{{0, Vector3d(5.0, 5.0, 0.0), Isometry3d(Translation3d(0, 0.6, 0))}}};
};

TEST_F(EvictedMap, IsReadAgainAndMoved) {
  ASSERT_EQ(map_.memory_use().resident_tiles, 0U);
  const auto corrected = map_.correct(correction_);
  ASSERT_TRUE(corrected);
  EXPECT_GT(corrected->moved_voxels, 3000U);
  for (const Vector3f& mean : means(*map_.view())) EXPECT_NEAR(mean.y(), 10.65, 2e-3);
  const MapCheckpoint next = map_.checkpoint();
  EXPECT_GE(next.records.size(), 2U) << "and is to be stored";
}

TEST_F(EvictedMap, IsLeftAloneWhereItWouldNotFitIntoMemory) {
  map_.insert(at(2, wall(900.0)), Isometry3d(Translation3d(1900.0, 0.0, 0.0)));
  const auto view = map_.view();
  EXPECT_FALSE(map_.correct(correction_, 1000));
  EXPECT_EQ(map_.view(), view);
  EXPECT_GT(map_.memory_use().non_resident_tiles, 0U);
}

TEST_F(EvictedMap, NothingIsLostWhereATileCannotBeRead) {
  // The wall's second half is to move into it.
  const MapCorrection along({{0, Vector3d(5.0, 5.0, 0.0), Isometry3d(Translation3d(-20, 0, 0))}});
  store_->forget({0, 0});
  ASSERT_TRUE(map_.correct(along));
  std::size_t left = 0;
  for (const Vector3f& mean : means(*map_.view())) left += mean.x() > 20.0F ? 1 : 0;
  std::size_t expected = 0;
  for (const Vector3f& mean : means(*before_)) expected += mean.x() > 20.0F ? 1 : 0;
  EXPECT_EQ(left, expected);
}

TEST(CorrectedStaticMap, IsStoredAndReadAsItIs) {
  StaticMap map(config());
  map.insert(at(1, wall(10.05)), Isometry3d::Identity());
  ASSERT_TRUE(map.correct(correction(0, Isometry3d(Translation3d(0.3, 0.4, 0.0)))));
  const MapCheckpoint checkpoint = map.checkpoint(CheckpointScope::everything);
  TileEvidenceMap evidence;
  for (const auto& [id, record] : checkpoint.records) evidence[id] = record.evidence;
  StaticMap again(config());
  again.resume(*checkpoint.view, evidence);
  again.insert(at(2, wall(10.45)), Isometry3d(Translation3d(0.3, 0.0, 0.0)));
  map.insert(at(2, wall(10.45)), Isometry3d(Translation3d(0.3, 0.0, 0.0)));
  const auto one = map.view();
  const auto other = again.view();
  ASSERT_EQ(one->tiles.size(), other->tiles.size());
  for (std::size_t i = 0; i < one->tiles.size(); ++i)
    EXPECT_EQ(one->tiles[i]->info.content_hash, other->tiles[i]->info.content_hash);
}

}  // namespace
}  // namespace stillmap
