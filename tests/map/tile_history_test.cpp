#include "core/map/query/tile_history.hpp"

#include <gmock/gmock.h>

namespace stillmap {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Event = TileHistory::Event;

std::shared_ptr<const MapSnapshot> view_of(std::uint64_t version, const std::vector<TileId>& ids,
                                           std::uint64_t map_id = 7) {
  MapSnapshot view{
      .version = version, .map_id = map_id, .tile_size_m = 20.0, .voxel_size_m = 0.2, .tiles = {}};
  for (const TileId id : ids) {
    Tile tile;
    tile.info.id = id;
    view.tiles.set(std::make_shared<const Tile>(std::move(tile)));
  }
  return std::make_shared<const MapSnapshot>(std::move(view));
}

MapState first(const std::shared_ptr<const MapSnapshot>& view) {
  return {view, std::make_shared<const TileHistory>(history_from(*view))};
}

MapState next(const MapState& before, const std::shared_ptr<const MapSnapshot>& view,
              std::size_t max_removed = max_removed_tiles) {
  return {view, std::make_shared<const TileHistory>(history_with(before, *view, max_removed))};
}

TEST(TileHistory, RemembersWhenTilesGo) {
  MapState state = first(view_of(3, {{0, 0}}));
  EXPECT_EQ(state.history->known_since, 3U);
  state = next(state, view_of(5, {{0, 0}, {0, 1}}));
  EXPECT_THAT(state.history->removed, IsEmpty());
  state = next(state, view_of(6, {{0, 1}}));
  EXPECT_THAT(state.history->removed, ElementsAre(Event{{0, 0}, 6}));
  EXPECT_EQ(state.history->version, 6U);
  EXPECT_EQ(state.history->known_since, 3U);
}

TEST(TileHistory, ATileThatComesBackIsNoRemovedOne) {
  MapState state = first(view_of(1, {{0, 0}}));
  state = next(state, view_of(2, {}));
  state = next(state, view_of(4, {{0, 0}}));
  EXPECT_THAT(state.history->removed, IsEmpty());
}

TEST(TileHistory, ForgetsTheOldestRemovalsAndSaysSo) {
  MapState state = first(view_of(1, {{0, 0}, {0, 1}, {0, 2}}));
  state = next(state, view_of(2, {{0, 1}, {0, 2}}), 2);
  state = next(state, view_of(3, {{0, 2}}), 2);
  EXPECT_EQ(state.history->known_since, 1U);
  state = next(state, view_of(4, {}), 2);
  EXPECT_THAT(state.history->removed, ElementsAre(Event{{0, 1}, 3}, Event{{0, 2}, 4}));
  EXPECT_EQ(state.history->known_since, 2U);
}

TEST(TileHistory, BeginsAnewWithAnotherMap) {
  MapState state = first(view_of(5, {{0, 0}}));
  state = next(state, view_of(9, {{1, 1}}, 8));
  EXPECT_EQ(state.history->map_id, 8U);
  EXPECT_EQ(state.history->known_since, 9U);
  EXPECT_THAT(state.history->removed, IsEmpty());
  state = next(state, view_of(2, {}, 8));
  EXPECT_EQ(state.history->known_since, 2U);
}

}  // namespace
}  // namespace stillmap
