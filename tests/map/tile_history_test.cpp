#include "core/map/query/tile_history.hpp"

#include <gmock/gmock.h>

namespace stillmap {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Event = TileHistory::Event;

MapSnapshot view_of(std::uint64_t version, const std::vector<Event>& tiles,
                    std::uint64_t map_id = 7) {
  MapSnapshot view{
      .version = version, .map_id = map_id, .tile_size_m = 20.0, .voxel_size_m = 0.2, .tiles = {}};
  for (const auto& [id, revision] : tiles) {
    Tile tile;
    tile.info.id = id;
    tile.info.revision = revision;
    view.tiles.push_back(std::make_shared<const Tile>(std::move(tile)));
  }
  return view;
}

TEST(TileHistory, RemembersWhenTilesAppearAndGo) {
  TileHistory history = history_from(view_of(3, {{{0, 0}, 2}}));
  EXPECT_EQ(history.known_since, 3U);
  history = history_with(history, view_of(5, {{{0, 0}, 5}, {{0, 1}, 4}}));
  EXPECT_THAT(history.appeared, ElementsAre(Event{{0, 0}, 2}, Event{{0, 1}, 4}));
  history = history_with(history, view_of(6, {{{0, 1}, 4}}));
  EXPECT_THAT(history.appeared, ElementsAre(Event{{0, 1}, 4}));
  EXPECT_THAT(history.removed, ElementsAre(Event{{0, 0}, 6}));
  EXPECT_EQ(history.version, 6U);
  EXPECT_EQ(history.known_since, 3U);
}

TEST(TileHistory, ATileThatComesBackAppearsAgain) {
  TileHistory history = history_from(view_of(1, {{{0, 0}, 1}}));
  history = history_with(history, view_of(2, {}));
  history = history_with(history, view_of(4, {{{0, 0}, 4}}));
  EXPECT_THAT(history.removed, IsEmpty());
  EXPECT_THAT(history.appeared, ElementsAre(Event{{0, 0}, 4}));
}

TEST(TileHistory, ForgetsTheOldestRemovalsAndSaysSo) {
  TileHistory history = history_from(view_of(1, {{{0, 0}, 1}, {{0, 1}, 1}, {{0, 2}, 1}}));
  history = history_with(history, view_of(2, {{{0, 1}, 1}, {{0, 2}, 1}}), 2);
  history = history_with(history, view_of(3, {{{0, 2}, 1}}), 2);
  EXPECT_EQ(history.known_since, 1U);
  history = history_with(history, view_of(4, {}), 2);
  EXPECT_THAT(history.removed, ElementsAre(Event{{0, 1}, 3}, Event{{0, 2}, 4}));
  EXPECT_EQ(history.known_since, 2U);
}

TEST(TileHistory, BeginsAnewWithAnotherMap) {
  TileHistory history = history_from(view_of(5, {{{0, 0}, 1}}));
  history = history_with(history, view_of(9, {{{1, 1}, 8}}, 8));
  EXPECT_EQ(history.map_id, 8U);
  EXPECT_EQ(history.known_since, 9U);
  EXPECT_THAT(history.removed, IsEmpty());
  history = history_with(history, view_of(2, {}, 8));
  EXPECT_EQ(history.known_since, 2U);
}

}  // namespace
}  // namespace stillmap
