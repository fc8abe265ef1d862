#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <set>
#include <vector>

#include "core/map/live_tile.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "tests/map/ask_each.hpp"

namespace stillmap {
namespace {

const VoxelGrid movers_grid(0.2, 20.0);
constexpr TileId movers_tile{0, 0};
constexpr std::int64_t movers_period_ns = 100'000'000;

/// Voxels in a row, 10 m from the tile's corner.
std::uint32_t mover_key(int x, int y = 50, int z = 5) {
  return voxel_key(
      {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), static_cast<std::int16_t>(z)});
}

TilePoint mover_point(std::uint32_t key, SemanticClass label = SemanticClass::unlabeled) {
  return {.voxel_key = key, .offset = {100, 100, 100}, .label = label, .confidence = 1.0F};
}

/// A tile and its scans, ten a second, each of which clears.
class RestOfMovers : public testing::Test {
 protected:
  /// The next scan hits these voxels, and sees through those.
  void scan(const std::vector<TilePoint>& points, const std::set<int>& free_columns = {}) {
    const std::uint32_t number = stamps_.add(clock_offset_ns_ + movers_period_ns * ++scans_);
    tile_->insert(points, number);
    const VisibilityTest test{.is_free = ask_each([&](const Eigen::Vector3f& p_map, Thin) {
                                return free_columns.contains(static_cast<int>(p_map.x() / 0.2F));
                              }),
                              .times_free_before = {},
                              .last_scan_cleared = number,
                              .stamps = &stamps_};
    static_cast<void>(tile_->clear_seen_through(test, number, movers_rule));
  }
  /// Scans that hit nothing.
  void wait(int scans, const std::set<int>& free_columns = {}) {
    for (int k = 0; k < scans; ++k) scan({}, free_columns);
  }
  [[nodiscard]] std::set<std::uint32_t> shown() {
    static_cast<void>(tile_->publish(++revision_, movers_rule, stamps_));
    std::set<std::uint32_t> keys;
    if (tile_->published())
      for (const PackedVoxel& voxel : tile_->published()->voxels.packed()) keys.insert(voxel.key);
    return keys;
  }
  /// To the disk and back.
  void store_and_reload() {
    static_cast<void>(shown());
    const TileRecord record = tile_->record(movers_rule, stamps_);
    const TileRecord stored{
        std::make_shared<const Tile>(decode_tile(encode_tile(*record.tile), movers_grid)),
        std::make_shared<const TileEvidence>(
            decode_evidence(encode_evidence(*record.evidence), movers_grid))};
    tile_ = std::make_unique<LiveTile>(movers_tile, stored, movers_grid, stamps_);
  }

  VisibilityRule movers_rule;
  ScanStamps stamps_;
  std::unique_ptr<LiveTile> tile_ = std::make_unique<LiveTile>(movers_tile, movers_grid);
  std::int64_t scans_ = 0;
  std::int64_t clock_offset_ns_ = 0;
  std::uint64_t revision_ = 0;
};

TEST_F(RestOfMovers, IsHiddenFromWhatWasSeenThroughOnToAllThatTouches) {
  scan({mover_point(mover_key(10)), mover_point(mover_key(11)), mover_point(mover_key(12)),
        mover_point(mover_key(12, 51)), mover_point(mover_key(12, 51, 6)),
        mover_point(mover_key(20))});
  wait(1, {10});
  EXPECT_EQ(shown().size(), 5U) << "it may be seen again";
  wait(8);
  EXPECT_EQ(shown(), std::set{mover_key(20)});
  // As what rays passed: it can be listed and shown again.
  EXPECT_EQ(tile_->removed(movers_rule, stamps_).size(), 5U);
  for (const RemovedVoxel& voxel : tile_->removed(movers_rule, stamps_))
    EXPECT_EQ(voxel.reason, RemovalReason::seen_through);
  const Eigen::AlignedBox3d all(Eigen::Vector3d::Constant(-100.0),
                                Eigen::Vector3d::Constant(100.0));
  EXPECT_EQ(tile_->restore(RemovalReason::seen_through, all, movers_rule, stamps_), 5U);
  wait(20, {10});
  EXPECT_EQ(shown().size(), 6U);
}

TEST_F(RestOfMovers, OfAVehicleThatMovesOnIsHiddenScanByScan) {
  for (int k = 0; k < 12; ++k)
    scan({mover_point(mover_key(10 + k)), mover_point(mover_key(10 + k, 51)),
          mover_point(mover_key(10 + k, 52))});
  std::set<int> passed_by_rays;
  for (int k = 0; k < 12; k += 3) passed_by_rays.insert(10 + k);
  wait(10, passed_by_rays);
  EXPECT_TRUE(shown().empty());
}

TEST_F(RestOfMovers, IsNotWhatIsSeenForLongOrTouchesThat) {
  for (int k = 0; k < 10; ++k) scan({mover_point(mover_key(11)), mover_point(mover_key(30))});
  scan({mover_point(mover_key(10)), mover_point(mover_key(12)), mover_point(mover_key(30, 51)),
        mover_point(mover_key(29, 51)), mover_point(mover_key(31, 51))});
  wait(10, {10, 29});
  EXPECT_EQ(shown(), (std::set{mover_key(11), mover_key(12), mover_key(30), mover_key(30, 51),
                               mover_key(31, 51)}));
}

TEST_F(RestOfMovers, IsNotWhatWasSeenAtAnotherTime) {
  scan({mover_point(mover_key(10))});
  wait(2);
  scan({mover_point(mover_key(11))});
  wait(10, {10});
  EXPECT_EQ(shown(), std::set{mover_key(11)});
}

TEST_F(RestOfMovers, IsWhateverLabelsTakeItForExceptGroundThatTheyAreSureOf) {
  using enum SemanticClass;
  for (const SemanticClass label : {building, vegetation, fence, pole, road, terrain}) {
    for (const float confidence : {0.3F, 0.9F}) {
      tile_ = std::make_unique<LiveTile>(movers_tile, movers_grid);
      TilePoint rest = mover_point(mover_key(11), label);
      rest.confidence = confidence;
      scan({mover_point(mover_key(10)), rest});
      wait(10, {10});
      EXPECT_EQ(shown().contains(mover_key(11)), is_ground(label) && confidence > 0.5F)
          << name(label) << " " << confidence;
    }
  }
}

/// The side of a tram that waits: networks are sure that it is a wall.
TEST_F(RestOfMovers, OfAVehicleTakenForABuildingGoesAsWithoutLabels) {
  for (const SemanticClass label : {SemanticClass::unlabeled, SemanticClass::building}) {
    tile_ = std::make_unique<LiveTile>(movers_tile, movers_grid);
    std::vector<TilePoint> side;
    for (int k = 0; k < 12; ++k) side.push_back(mover_point(mover_key(10 + k), label));
    for (TilePoint& point : side) point.confidence = 0.9F;
    for (int k = 0; k < 100; ++k) scan(side);
    // It drives on, and leaves a voxel free a scan; where it then is, it is seen for a moment.
    std::set<int> free_columns;
    for (int k = 0; k < 12; ++k) {
      TilePoint front = mover_point(mover_key(22 + k), label);
      front.confidence = 0.9F;
      free_columns.insert(10 + k);
      scan({front}, free_columns);
    }
    // Rays pass every third voxel of its way.
    for (int k = 0; k < 12; k += 3) free_columns.insert(22 + k);
    wait(20, free_columns);
    EXPECT_TRUE(shown().empty()) << name(label) << ": " << shown().size() << " left";
  }
}

TEST_F(RestOfMovers, IsShownOnceItIsSeenAgain) {
  for (const bool is_reloaded : {false, true}) {
    const int x = is_reloaded ? 40 : 10;
    scan({mover_point(mover_key(x)), mover_point(mover_key(x + 1))});
    wait(10, {x});
    ASSERT_FALSE(shown().contains(mover_key(x + 1)));
    if (is_reloaded) store_and_reload();
    EXPECT_FALSE(shown().contains(mover_key(x + 1)));
    scan({mover_point(mover_key(x)), mover_point(mover_key(x + 1))});
    EXPECT_TRUE(shown().contains(mover_key(x + 1)));
    EXPECT_FALSE(shown().contains(mover_key(x))) << "a ray passed this one";
  }
}

TEST_F(RestOfMovers, ThatRaysPassLaterIsHiddenAsAllElse) {
  scan({mover_point(mover_key(10)), mover_point(mover_key(11))});
  wait(10, {10});
  ASSERT_TRUE(shown().empty());
  wait(1, {11});
  scan({mover_point(mover_key(11))});
  EXPECT_TRUE(shown().empty());
}

TEST_F(RestOfMovers, StaysHiddenWhereOneRayIsNotEnough) {
  movers_rule.misses_to_clear = 3;
  scan({mover_point(mover_key(10)), mover_point(mover_key(11))});
  wait(10, {10});
  ASSERT_TRUE(shown().empty());
  wait(1, {11});
  EXPECT_TRUE(shown().empty());
  scan({mover_point(mover_key(11))});
  EXPECT_EQ(shown(), std::set{mover_key(11)});
}

TEST_F(RestOfMovers, IsNotWhatWasSeenBeforeTheClockWasSetBack) {
  for (int k = 0; k < 10; ++k) scan({mover_point(mover_key(11)), mover_point(mover_key(30))});
  clock_offset_ns_ = -1'000'000'000'000;
  scan({mover_point(mover_key(10)), mover_point(mover_key(11)), mover_point(mover_key(12)),
        mover_point(mover_key(20)), mover_point(mover_key(21))});
  wait(10, {10, 20});
  EXPECT_EQ(shown(), (std::set{mover_key(11), mover_key(12), mover_key(30)}))
      << "21 is the rest of what was at 20; 11 was seen before, and 12 touches it";
}

TEST_F(RestOfMovers, IsShownOnceItIsSeenAgainInAnotherSession) {
  scan({mover_point(mover_key(10)), mover_point(mover_key(11)), mover_point(mover_key(40))});
  wait(10, {10});
  ASSERT_EQ(shown(), std::set{mover_key(40)});
  store_and_reload();
  constexpr std::uint32_t remembered_scans = 20;
  tile_->begin_session(remembered_scans, movers_rule);
  EXPECT_EQ(shown(), std::set{mover_key(40)});
  scan({mover_point(mover_key(10)), mover_point(mover_key(11))});
  EXPECT_EQ(shown(), (std::set{mover_key(11), mover_key(40)}));
}

TEST_F(RestOfMovers, EndsAtTheTileAndAtWhatIsNotThere) {
  const auto corner = {mover_point(mover_key(0, 0, 5)), mover_point(mover_key(0, 1, 5)),
                       mover_point(mover_key(99, 99, 5)), mover_point(mover_key(98, 99, 5))};
  scan(corner);
  wait(10, {0, 99});
  EXPECT_TRUE(shown().empty());
}

}  // namespace
}  // namespace stillmap
