#include <gmock/gmock.h>

#include "clients/library/region_subscription.hpp"

namespace stillmap::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr dds::MapIdentity first_map{
    .version = 1, .map_id = 1, .tile_size_m = 20, .voxel_size_m = 0.2};
constexpr dds::MapIdentity second_map{
    .version = 1, .map_id = 2, .tile_size_m = 20, .voxel_size_m = 0.2};

TileInfo info(TileId id, std::uint32_t voxels = 5, std::uint64_t revision = 1) {
  TileInfo info;
  info.id = id;
  info.revision = revision;
  info.voxel_count = voxels;
  return info;
}

TileSet tiles(const dds::MapIdentity& map, const std::vector<TileId>& ids,
              const std::vector<TileId>& missing = {}) {
  TileSet set;
  set.map = map;
  set.missing = missing;
  for (const TileId id : ids) set.tiles.push_back({info(id), {}});
  return set;
}

std::vector<TileId> ids(const std::vector<Tile>& tiles) {
  std::vector<TileId> out;
  for (const Tile& tile : tiles) out.push_back(tile.info.id);
  return out;
}

/// The tiles 0 and 1 of row 0, and no others.
RegionTracker two_tiles() {
  return {CorridorRegion{.path_map = {{5, 10}, {35, 10}}, .half_width_m = 2.0, .heights = {}},
          20.0};
}

TEST(RegionTracker, WantsTilesOfItsRegionOnly) {
  RegionTracker tracker = two_tiles();
  for (const TileId id : {TileId{0, 0}, {1, 0}, {2, 0}, {0, 1}, {-1, 0}}) {
    tracker.add_index_entry(first_map, info(id));
  }
  EXPECT_THAT(tracker.pending(), ElementsAre(TileId{0, 0}, TileId{1, 0}));
}

TEST(RegionTracker, TellsWhatAppearsChangesAndGoes) {
  RegionTracker tracker = two_tiles();
  tracker.add_index_entry(first_map, info({0, 0}));
  EXPECT_THAT(ids(tracker.take_update(tiles(first_map, {{0, 0}})).appeared),
              ElementsAre(TileId{0, 0}));
  EXPECT_FALSE(tracker.has_update());
  tracker.add_index_entry(first_map, info({0, 0}));
  EXPECT_FALSE(tracker.has_update()) << "what was fetched already";
  tracker.add_index_entry(first_map, info({0, 0}, 5, 2));
  tracker.add_index_entry(first_map, info({1, 0}));
  RegionUpdate update = tracker.take_update(tiles(first_map, {{0, 0}, {1, 0}}));
  EXPECT_THAT(ids(update.changed), ElementsAre(TileId{0, 0}));
  EXPECT_THAT(ids(update.appeared), ElementsAre(TileId{1, 0}));
  tracker.add_index_entry(first_map, info({0, 0}, 0));
  EXPECT_THAT(tracker.pending(), IsEmpty());
  EXPECT_THAT(tracker.take_update({}).removed, ElementsAre(TileId{0, 0}));
  // Gone before anybody looked.
  tracker.add_index_entry(first_map, info({0, 0}));
  tracker.add_index_entry(first_map, info({0, 0}, 0));
  EXPECT_FALSE(tracker.has_update());
}

TEST(RegionTracker, ATileThatIsGoneWhenItIsFetchedIsRemoved) {
  RegionTracker tracker = two_tiles();
  tracker.add_index_entry(first_map, info({0, 0}));
  (void)tracker.take_update(tiles(first_map, {{0, 0}}));
  tracker.add_index_entry(first_map, info({0, 0}));
  EXPECT_THAT(tracker.take_update(tiles(first_map, {}, {{0, 0}})).removed,
              ElementsAre(TileId{0, 0}));
}

TEST(RegionTracker, AnotherMapReplacesAllTiles) {
  RegionTracker tracker = two_tiles();
  tracker.add_index_entry(first_map, info({0, 0}));
  tracker.add_index_entry(first_map, info({1, 0}));
  (void)tracker.take_update(tiles(first_map, {{0, 0}, {1, 0}}));
  tracker.add_index_entry(second_map, info({1, 0}));
  const RegionUpdate update = tracker.take_update(tiles(second_map, {{1, 0}}));
  EXPECT_EQ(update.map.map_id, 2U);
  EXPECT_THAT(update.removed, ElementsAre(TileId{0, 0}));
  EXPECT_THAT(ids(update.changed), ElementsAre(TileId{1, 0}));
}

TEST(RegionTracker, LacksWhatTheIndexOfAnotherMapDoesNotHave) {
  RegionTracker tracker = two_tiles();
  tracker.add_present({.map = first_map, .tiles = {info({0, 0}), info({1, 0})}});
  EXPECT_FALSE(tracker.lacks_present());
  (void)tracker.take_update(tiles(first_map, {{0, 0}, {1, 0}}));
  tracker.add_index_entry(first_map, info({1, 0}, 5, 2));
  EXPECT_FALSE(tracker.lacks_present());
  // The server was killed: what it has loaded is another map, whose index begins round the robot,
  // which is not in the region.
  tracker.add_index_entry(second_map, info({9, 9}));
  EXPECT_TRUE(tracker.lacks_present());
  tracker.add_present({.map = second_map, .tiles = {info({0, 0}), info({1, 0}), info({2, 0})}});
  EXPECT_FALSE(tracker.lacks_present());
  EXPECT_THAT(tracker.pending(), ElementsAre(TileId{0, 0}, TileId{1, 0}));
  EXPECT_EQ(tracker.take_update(tiles(second_map, {{0, 0}, {1, 0}})).changed.size(), 2U);
}

TEST(RegionTracker, LacksWhatAMapHasThatTheIndexNeverSpeaksOf) {
  RegionTracker tracker = two_tiles();
  tracker.note_map(1);
  tracker.add_present({.map = first_map, .tiles = {info({0, 0}), info({1, 0})}});
  (void)tracker.take_update(tiles(first_map, {{0, 0}, {1, 0}}));
  tracker.note_map(1);
  EXPECT_FALSE(tracker.lacks_present());
  // A reset: no tile of the new map is here, nor round the robot yet.
  tracker.note_map(2);
  EXPECT_TRUE(tracker.lacks_present());
  tracker.add_present({.map = second_map, .tiles = {}});
  EXPECT_FALSE(tracker.lacks_present());
  ASSERT_TRUE(tracker.has_update());
  const RegionUpdate update = tracker.take_update({});
  EXPECT_EQ(update.map.map_id, 2U);
  EXPECT_THAT(update.removed, ElementsAre(TileId{0, 0}, TileId{1, 0}));
}

TEST(RegionTracker, AStatusThatIsOlderThanTheListIsBelievedOnce) {
  RegionTracker tracker = two_tiles();
  tracker.add_present({.map = second_map, .tiles = {info({0, 0})}});
  tracker.note_map(1);
  EXPECT_TRUE(tracker.lacks_present());
  tracker.add_present({.map = second_map, .tiles = {info({0, 0})}});
  tracker.note_map(1);
  tracker.note_map(2);
  EXPECT_FALSE(tracker.lacks_present());
  EXPECT_THAT(tracker.pending(), ElementsAre(TileId{0, 0}));
}

TEST(RegionTracker, TilesOfAnotherMapMayHaveAnotherEdge) {
  RegionTracker tracker = two_tiles();
  tracker.add_index_entry(first_map, info({0, 0}));
  (void)tracker.take_update(tiles(first_map, {{0, 0}}));
  dds::MapIdentity finer = second_map;
  finer.tile_size_m = 10.0;
  // 20 to 30 m along x, and 10 to 20 m: the region ends at 37 m.
  for (const TileId id : {TileId{2, 1}, {3, 1}, {4, 1}}) tracker.add_index_entry(finer, info(id));
  EXPECT_EQ(tracker.tile_size_m(), 10.0);
  EXPECT_THAT(tracker.pending(), ElementsAre(TileId{2, 1}, TileId{3, 1}));
  EXPECT_THAT(tracker.take_update({}).removed, ElementsAre(TileId{0, 0}));
}

TEST(RegionTracker, LeavesTilesOfAMapThatTheIndexHasNotSpokenOf) {
  RegionTracker tracker = two_tiles();
  tracker.add_index_entry(first_map, info({0, 0}));
  const RegionUpdate update = tracker.take_update(tiles(second_map, {{0, 0}}));
  EXPECT_THAT(update.appeared, IsEmpty());
  EXPECT_THAT(tracker.pending(), ElementsAre(TileId{0, 0}));
}

}  // namespace
}  // namespace stillmap::cli
