#include "core/map/live_tile.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "core/map/storage/tile_codec.hpp"
#include "tests/map/ask_each.hpp"

namespace stillmap {
namespace {

const VoxelGrid live_grid(0.2, 20.0);
constexpr TileId live_id{2, -1};
constexpr VisibilityRule rule;

TilePoint point_in(std::uint32_t key, SemanticClass label = SemanticClass::road) {
  return {.voxel_key = key, .offset = {10, 20, 30}, .label = label, .confidence = 1.0F};
}

/// Points at random in a few thousand voxels, some of them of things that move.
std::vector<TilePoint> scan_of(std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<TilePoint> points(3000);
  for (TilePoint& point : points) {
    const VoxelIndex index{static_cast<std::uint16_t>(random() % 100),
                           static_cast<std::uint16_t>(random() % 20),
                           static_cast<std::int16_t>(random() % 3)};
    point.voxel_key = voxel_key(index);
    for (auto& offset : point.offset) offset = static_cast<std::uint8_t>(random());
    point.label = static_cast<SemanticClass>(random() % semantic_class_count);
    point.motion = static_cast<Motion>(random() % 3);
    point.confidence = static_cast<float>(random() % 1000) / 1000.0F;
  }
  return points;
}

bool every_fourth_is_free(const Eigen::Vector3f& position_map, Thin) {
  return static_cast<int>(std::floor(position_map.x() * 5.0F)) % 4 == 0;
}

/// Of earlier scans some passed what is new.
VisibilityTest visibility_after(std::uint32_t last_scan_cleared) {
  return {.is_free = ask_each(every_fourth_is_free),
          .times_free_before = ask_each([](const Eigen::Vector3f& position_map, Thin) {
            return static_cast<std::uint32_t>(std::floor(position_map.y() * -5.0F)) % 3;
          }),
          .last_scan_cleared = last_scan_cleared};
}

void expect_same(const TileRecord& a, const TileRecord& b) {
  ASSERT_TRUE(a.tile && b.tile);
  EXPECT_EQ(a.tile->info.content_hash, b.tile->info.content_hash);
  EXPECT_TRUE(std::ranges::equal(a.tile->voxels.packed(), b.tile->voxels.packed()));
  EXPECT_TRUE(std::ranges::equal(a.tile->voxels.stamps_ns(), b.tile->voxels.stamps_ns()));
  EXPECT_EQ(a.evidence->shown, b.evidence->shown);
  EXPECT_TRUE(std::ranges::equal(a.evidence->hidden.packed(), b.evidence->hidden.packed()));
  EXPECT_EQ(a.evidence->hidden_states, b.evidence->hidden_states);
  EXPECT_EQ(a.evidence->excluded, b.evidence->excluded);
}

TEST(LiveTile, GoesOnFromItsRecordAsIfItHadStayed) {
  ScanStamps stamps;
  ScanStamps reloaded_stamps;
  LiveTile kept(live_id, live_grid);
  auto reloaded = std::make_unique<LiveTile>(live_id, live_grid);
  std::uint32_t last_number = 0;
  std::uint32_t last_other_number = 0;
  for (std::uint32_t scan = 0; scan < 40; ++scan) {
    // Time goes back once.
    const std::int64_t stamp_ns = 1'000'000'000LL * scan - (scan == 17 ? 5'000'000'001LL : 0);
    const auto points = scan_of(scan);
    const std::uint32_t number = stamps.add(stamp_ns);
    kept.insert(points, number);
    (void)kept.clear_seen_through(visibility_after(last_number), number, rule);
    (void)kept.publish(scan + 1, rule, stamps);
    const std::uint32_t other_number = reloaded_stamps.add(stamp_ns);
    reloaded->insert(points, other_number);
    (void)reloaded->clear_seen_through(visibility_after(last_other_number), other_number, rule);
    last_number = number;
    (void)reloaded->publish(scan + 1, rule, reloaded_stamps);
    const TileRecord record = reloaded->record(rule, reloaded_stamps);
    expect_same(record, kept.record(rule, stamps));
    // To the disk and back, into a table of stamps of its own.
    const TileRecord stored{
        std::make_shared<const Tile>(decode_tile(encode_tile(*record.tile), live_grid)),
        std::make_shared<const TileEvidence>(
            decode_evidence(encode_evidence(*record.evidence), live_grid))};
    reloaded_stamps.clear();
    reloaded = std::make_unique<LiveTile>(live_id, stored, live_grid, reloaded_stamps);
    expect_same(reloaded->record(rule, reloaded_stamps), record);
    last_other_number = reloaded_stamps.add(-1);
  }
}

/// Whether the scan saw through this place, at random.
bool is_free_in(std::uint32_t scan, const Eigen::Vector3f& position_map) {
  const Eigen::Array3f place = (position_map.array() * 5.0F).floor();
  const auto seed = static_cast<std::uint32_t>(1000.0F * place[0] + 100.0F * place[1] + place[2]);
  return std::mt19937(seed + 77'777U * scan)() % 3 == 0;
}

TEST(LiveTile, CountsTheMissesOfLaterScansAndOfThoseKeptBefore) {
  constexpr std::uint32_t scans = 30;
  constexpr std::uint32_t kept_scans = 4;
  LiveTile tile(live_id, live_grid);
  ScanStamps stamps;
  std::mt19937 random(3);
  std::map<std::uint32_t, std::set<std::uint32_t>> scans_that_hit;
  for (std::uint32_t scan = 0; scan < scans; ++scan) {
    std::vector<TilePoint> points;
    for (int i = 0; i < 100; ++i) {
      const VoxelIndex index{static_cast<std::uint16_t>(random() % 20),
                             static_cast<std::uint16_t>(random() % 20), 0};
      points.push_back(point_in(voxel_key(index)));
      scans_that_hit[voxel_key(index)].insert(scan);
    }
    tile.insert(points, stamps.add(scan));
    const VisibilityTest test{
        .is_free =
            ask_each([&](const Eigen::Vector3f& p_map, Thin) { return is_free_in(scan, p_map); }),
        .times_free_before = ask_each([&](const Eigen::Vector3f& p_map, Thin) {
          std::uint32_t times = 0;
          for (std::uint32_t age = 1; age <= std::min(scan, kept_scans); ++age)
            times += is_free_in(scan - age, p_map) ? 1 : 0;
          return times;
        }),
        .last_scan_cleared = scan == 0 ? 0 : scan - 1};
    (void)tile.clear_seen_through(test, scan, rule);
  }
  (void)tile.publish(1, {.misses_to_clear = 1000}, stamps);
  const TileRecord record = tile.record({.misses_to_clear = 1000}, stamps);
  ASSERT_EQ(record.evidence->shown.size(), scans_that_hit.size());
  for (std::size_t i = 0; i < record.tile->voxels.size(); ++i) {
    const Voxel voxel = record.tile->voxels[i];
    const std::set<std::uint32_t>& hits = scans_that_hit.at(voxel_key(voxel.index));
    int misses = 0;
    for (std::uint32_t scan = 0; scan < scans; ++scan) {
      const bool is_asked = !hits.contains(scan) && scan + kept_scans >= *hits.begin();
      misses += is_asked && is_free_in(scan, voxel.mean_map) ? 1 : 0;
    }
    EXPECT_EQ(record.evidence->shown[i].misses, misses);
    EXPECT_EQ(record.evidence->shown[i].hits, hits.size());
  }
}

/// A mover that a network takes for a bush is seldom a sure one.
TEST(LiveTile, OnlyASureClassTakesMoreMissesToClear) {
  const auto shown_after = [](std::uint32_t misses, SemanticClass label, float confidence,
                              int hits = 3) {
    ScanStamps stamps;
    LiveTile tile(live_id, live_grid);
    TilePoint point = point_in(voxel_key({7, 8, 1}), label);
    point.confidence = confidence;
    for (int i = 0; i < hits; ++i) tile.insert(std::array{point}, stamps.add(i));
    const VisibilityTest test{
        .is_free = ask_each([](const Eigen::Vector3f&, Thin) { return true; }),
        .times_free_before = {},
        .last_scan_cleared = 0};
    for (std::uint32_t miss = 0; miss < misses; ++miss)
      (void)tile.clear_seen_through(test, stamps.add(hits + 10 + miss), rule);
    (void)tile.publish(1, rule, stamps);
    return !tile.record(rule, stamps).evidence->shown.empty();
  };
  EXPECT_TRUE(shown_after(0, SemanticClass::unlabeled, 1.0F));
  EXPECT_FALSE(shown_after(1, SemanticClass::unlabeled, 1.0F));
  EXPECT_FALSE(shown_after(1, SemanticClass::vegetation, 0.6F));
  EXPECT_TRUE(shown_after(rule.label_trust - 1, SemanticClass::vegetation, 0.8F));
  EXPECT_FALSE(shown_after(rule.label_trust, SemanticClass::vegetation, 0.8F));
  // A wall that few beams hit, and what was hit for long: that may be a tram that left.
  EXPECT_TRUE(shown_after(rule.label_trust - 1, SemanticClass::building, 0.9F));
  EXPECT_FALSE(shown_after(rule.label_trust, SemanticClass::building, 0.9F));
  EXPECT_TRUE(shown_after(6, SemanticClass::fence, 0.9F, 31));
  EXPECT_FALSE(shown_after(6, SemanticClass::building, 0.9F, 31));
}

/// Clears what no more than rays beside it tells of.
TEST(LiveTile, WhatOneBeamAloneHitIsThinInItsRecordToo) {
  ScanStamps stamps;
  LiveTile tile(live_id, live_grid);
  TilePoint bar = point_in(voxel_key({7, 8, 1}));
  bar.is_thin = true;
  tile.insert(std::array{bar, point_in(voxel_key({9, 8, 1}))}, stamps.add(5));
  (void)tile.publish(1, rule, stamps);
  const TileRecord record = tile.record(rule, stamps);
  const TileRecord stored{
      std::make_shared<const Tile>(decode_tile(encode_tile(*record.tile), live_grid)),
      std::make_shared<const TileEvidence>(
          decode_evidence(encode_evidence(*record.evidence), live_grid))};
  LiveTile reloaded(live_id, stored, live_grid, stamps);
  const VisibilityTest test{
      .is_free = ask_each([](const Eigen::Vector3f&, Thin thin) { return thin == Thin::no; }),
      .times_free_before = {},
      .last_scan_cleared = 0};
  for (std::uint32_t miss = 0; miss < 10; ++miss)
    (void)reloaded.clear_seen_through(test, stamps.add(20 + miss), rule);
  (void)reloaded.publish(2, rule, stamps);
  ASSERT_TRUE(reloaded.published());
  ASSERT_EQ(reloaded.published()->voxels.size(), 1U);
  EXPECT_EQ(voxel_key(reloaded.published()->voxels[0].index), bar.voxel_key);
}

TEST(LiveTile, OfAVoxelThatAFileExcludesTooTheVoxelStays) {
  ScanStamps stamps;
  LiveTile tile(live_id, live_grid);
  const VoxelIndex index{7, 8, 1};
  const std::uint32_t scan = stamps.add(5);
  for (int i = 0; i < 10; ++i) tile.insert(std::array{point_in(voxel_key(index))}, scan);
  (void)tile.publish(1, rule, stamps);
  TileRecord record = tile.record(rule, stamps);
  TileEvidence evidence = *record.evidence;
  evidence.excluded.push_back({index, SemanticClass::car, true, 5});
  record.evidence = std::make_shared<const TileEvidence>(evidence);
  LiveTile reloaded(live_id, record, live_grid, stamps);
  const Eigen::AlignedBox3d everywhere(Eigen::Vector3d::Constant(-1e3),
                                       Eigen::Vector3d::Constant(1e3));
  EXPECT_EQ(reloaded.restore(RemovalReason::moving, everywhere, rule, stamps), 0U);
  (void)reloaded.publish(2, rule, stamps);
  const TileRecord back = reloaded.record(rule, stamps);
  EXPECT_EQ(decode_tile(encode_tile(*back.tile), live_grid).voxels.size(), 1U);
  EXPECT_TRUE(back.evidence->excluded.empty());
}

TEST(LiveTile, ABoxThatBeginsOrEndsWhereARemovedVoxelLiesRestoresIt) {
  ScanStamps stamps;
  for (const bool is_end : {false, true}) {
    LiveTile tile(live_id, live_grid);
    for (std::uint32_t seed = 1; seed < 4; ++seed) tile.insert(scan_of(seed), stamps.add(seed));
    for (std::uint32_t miss = 0; miss < rule.label_trust; ++miss)
      (void)tile.clear_seen_through(visibility_after(0), stamps.add(10 + miss), rule);
    (void)tile.publish(1, rule, stamps);
    const std::vector<RemovedVoxel> removed = tile.removed(rule, stamps);
    EXPECT_GT(std::ranges::count(removed, RemovalReason::seen_through, &RemovedVoxel::reason), 500);
    for (const RemovedVoxel& voxel : removed) {
      const Eigen::Vector3d position_map = voxel.position_map.cast<double>();
      Eigen::AlignedBox3d box_map(position_map);
      box_map.extend(position_map + Eigen::Vector3d::Constant(is_end ? -0.001 : 0.001));
      EXPECT_EQ(tile.restore(voxel.reason, box_map, rule, stamps), 1U) << position_map.transpose();
    }
  }
}

TEST(LiveTile, FindsEveryVoxel) {
  LiveTile tile(live_id, live_grid);
  ScanStamps stamps;
  std::mt19937 random(4);
  std::map<std::uint32_t, int> points;
  for (int i = 0; i < 100'000; ++i) {
    const auto key = static_cast<std::uint32_t>(random() % 30'000) * 2'654'435'761U;
    ++points[key];
    tile.insert(std::array{point_in(key)}, stamps.add(i));
    if (i % 7'000 == 0) (void)tile.publish(1, rule, stamps);
  }
  for (const auto& [key, count] : points) {
    const float weight = tile.evidence(key).votes()[0].weight;
    EXPECT_EQ(weight, static_cast<float>(count));
    EXPECT_EQ(tile.evidence(key + 1).winner(),
              points.contains(key + 1) ? SemanticClass::road : SemanticClass::unlabeled);
  }
}

TEST(LiveTile, CountsEndAtTheirBounds) {
  LiveTile tile(live_id, live_grid);
  ScanStamps stamps;
  TilePoint point = point_in(voxel_key({1, 2, 3}));
  for (int i = 0; i < 255; ++i) tile.insert(std::array{point}, stamps.add(i));
  point.offset = {255, 255, 255};
  for (int i = 255; i < 70'000; ++i) tile.insert(std::array{point}, stamps.add(i));
  ASSERT_TRUE(tile.publish(1, rule, stamps));
  const PackedVoxel voxel = tile.published()->voxels.packed()[0];
  EXPECT_EQ(voxel.point_count, 65'535);
  EXPECT_EQ(voxel.offset_sum, (std::array<std::uint16_t, 3>{2'550, 5'100, 7'650}))
      << "the mean is that of the first 255 points";
  EXPECT_EQ(voxel.evidence.votes()[0].weight, ClassEvidence::max_total);
  EXPECT_EQ(tile.record(rule, stamps).evidence->shown[0].hits, 65'535);
  EXPECT_EQ(tile.published()->voxels[0].first_seen_ns, 0);
  EXPECT_EQ(tile.published()->voxels[0].last_seen_ns, 69'999);
}

TEST(LiveTile, TakesFewBytesAVoxel) {
  LiveTile tile(live_id, live_grid);
  ScanStamps stamps;
  for (std::uint32_t scan = 0; scan < 30; ++scan) {
    std::vector<TilePoint> points = scan_of(scan);
    for (TilePoint& point : points) point.motion = Motion::stationary;
    tile.insert(points, stamps.add(scan));
    (void)tile.publish(scan + 1, {.min_points = 1'000'000'000}, stamps);
  }
  const auto record = tile.record({.min_points = 1'000'000'000}, stamps);
  const auto voxels = static_cast<double>(record.evidence->hidden.size());
  ASSERT_GT(voxels, 3000.0);
  EXPECT_LT(static_cast<double>(tile.memory_bytes() - sizeof(tile)) / voxels, 39.0);
}

TEST(ScanStamps, EachHasOneNumberWhateverTheOrder) {
  ScanStamps stamps;
  std::mt19937_64 random(2);
  std::map<std::int64_t, std::uint32_t> numbers;
  for (int i = 0; i < 5'000; ++i) {
    const auto stamp_ns = i % 3 == 0 ? static_cast<std::int64_t>(random() % 10'000) : 2'000 + i;
    const std::uint32_t number = stamps.add(stamp_ns);
    EXPECT_EQ(numbers.try_emplace(stamp_ns, number).first->second, number);
    EXPECT_EQ(stamps.stamp_ns(number), stamp_ns);
  }
}

}  // namespace
}  // namespace stillmap
