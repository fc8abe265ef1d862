#include "clients/library/region_tracker.hpp"

#include <gmock/gmock.h>

namespace stillmap {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr MapIdentity first_map{.version = 1, .map_id = 1, .tile_size_m = 20, .voxel_size_m = 0.2};
constexpr MapIdentity second_map{.version = 1, .map_id = 2, .tile_size_m = 20, .voxel_size_m = 0.2};

TileInfo info(TileId id, std::uint32_t voxels = 5) {
  TileInfo info;
  info.id = id;
  info.voxel_count = voxels;
  return info;
}

TileSet tiles(const MapIdentity& map, const std::vector<TileId>& ids,
              const std::vector<TileId>& missing = {}) {
  TileSet set{.map = map, .tiles = {}, .missing = missing};
  for (const TileId id : ids) set.tiles.push_back({info(id), {}});
  return set;
}

std::vector<TileId> ids(const std::vector<Tile>& tiles) {
  std::vector<TileId> out;
  for (const Tile& tile : tiles) out.push_back(tile.info.id);
  return out;
}

/// The tiles 0 and 1 of row 0, and no others.
RegionWatch two_tiles() {
  return {CorridorRegion{.path_map = {{5, 10}, {35, 10}}, .half_width_m = 2.0, .heights = {}},
          20.0};
}

TEST(RegionWatch, WantsTilesOfItsRegionOnly) {
  RegionWatch watch = two_tiles();
  for (const TileId id : {TileId{0, 0}, {1, 0}, {2, 0}, {0, 1}, {-1, 0}}) {
    watch.note(first_map, info(id));
  }
  EXPECT_THAT(watch.wanted(), ElementsAre(TileId{0, 0}, TileId{1, 0}));
}

TEST(RegionWatch, TellsWhatAppearsChangesAndGoes) {
  RegionWatch watch = two_tiles();
  watch.note(first_map, info({0, 0}));
  EXPECT_THAT(ids(watch.take_news(tiles(first_map, {{0, 0}})).appeared), ElementsAre(TileId{0, 0}));
  EXPECT_FALSE(watch.has_news());
  watch.note(first_map, info({0, 0}));
  watch.note(first_map, info({1, 0}));
  RegionNews news = watch.take_news(tiles(first_map, {{0, 0}, {1, 0}}));
  EXPECT_THAT(ids(news.changed), ElementsAre(TileId{0, 0}));
  EXPECT_THAT(ids(news.appeared), ElementsAre(TileId{1, 0}));
  watch.note(first_map, info({0, 0}, 0));
  EXPECT_THAT(watch.wanted(), IsEmpty());
  EXPECT_THAT(watch.take_news({}).removed, ElementsAre(TileId{0, 0}));
  // Gone before anybody looked.
  watch.note(first_map, info({0, 0}));
  watch.note(first_map, info({0, 0}, 0));
  EXPECT_FALSE(watch.has_news());
}

TEST(RegionWatch, ATileThatIsGoneWhenItIsFetchedIsRemoved) {
  RegionWatch watch = two_tiles();
  watch.note(first_map, info({0, 0}));
  (void)watch.take_news(tiles(first_map, {{0, 0}}));
  watch.note(first_map, info({0, 0}));
  EXPECT_THAT(watch.take_news(tiles(first_map, {}, {{0, 0}})).removed, ElementsAre(TileId{0, 0}));
}

TEST(RegionWatch, AnotherMapReplacesAllTiles) {
  RegionWatch watch = two_tiles();
  watch.note(first_map, info({0, 0}));
  watch.note(first_map, info({1, 0}));
  (void)watch.take_news(tiles(first_map, {{0, 0}, {1, 0}}));
  watch.note(second_map, info({1, 0}));
  const RegionNews news = watch.take_news(tiles(second_map, {{1, 0}}));
  EXPECT_EQ(news.map.map_id, 2U);
  EXPECT_THAT(news.removed, ElementsAre(TileId{0, 0}));
  EXPECT_THAT(ids(news.changed), ElementsAre(TileId{1, 0}));
}

TEST(RegionWatch, LeavesTilesOfAMapThatTheIndexHasNotSpokenOf) {
  RegionWatch watch = two_tiles();
  watch.note(first_map, info({0, 0}));
  const RegionNews news = watch.take_news(tiles(second_map, {{0, 0}}));
  EXPECT_THAT(news.appeared, IsEmpty());
  EXPECT_THAT(watch.wanted(), ElementsAre(TileId{0, 0}));
}

}  // namespace
}  // namespace stillmap
