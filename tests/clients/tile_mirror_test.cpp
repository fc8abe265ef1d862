#include "clients/library/tile_mirror.hpp"

#include <gmock/gmock.h>

#include <thread>

namespace stillmap::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using namespace std::chrono_literals;

constexpr dds::MapIdentity mirrored_map{
    .version = 4, .map_id = 1, .tile_size_m = 20, .voxel_size_m = 0.2};

Tile tile(TileId id, std::uint64_t revision) {
  Tile tile;
  tile.info.id = id;
  tile.info.revision = revision;
  tile.info.voxel_count = 1;
  tile.voxels = PackedVoxels(id, {0.2, 20.0}, std::vector<Voxel>(1));
  return tile;
}

RegionUpdate update(const dds::MapIdentity& map, std::vector<Tile> appeared,
                    std::vector<Tile> changed = {}, std::vector<TileId> removed = {}) {
  return {.map = map,
          .appeared = std::move(appeared),
          .changed = std::move(changed),
          .removed = std::move(removed)};
}

std::vector<std::pair<TileId, std::uint64_t>> content(const TileMirror& mirror) {
  std::vector<std::pair<TileId, std::uint64_t>> tiles;
  for (const auto& held : mirror.snapshot()->tiles) {
    tiles.emplace_back(held->info.id, held->info.revision);
  }
  return tiles;
}

TEST(TileMirror, BeginsEmpty) {
  const TileMirror mirror;
  EXPECT_THAT(content(mirror), IsEmpty());
  EXPECT_TRUE(mirror.holds({}));
}

TEST(TileMirror, HoldsTheTilesInOrderWithTheMapsSizes) {
  TileMirror mirror;
  mirror.apply(update(mirrored_map, {tile({2, 0}, 3), tile({-1, 5}, 4)}));
  EXPECT_THAT(content(mirror),
              ElementsAre(std::pair(TileId{-1, 5}, 4U), std::pair(TileId{2, 0}, 3U)));
  const auto view = mirror.snapshot();
  EXPECT_EQ(view->map_id, 1U);
  EXPECT_EQ(view->version, 4U);
  EXPECT_EQ(view->tile_size_m, 20.0);
  EXPECT_EQ(view->voxel_size_m, 0.2);
}

TEST(TileMirror, ChangesAndRemovalsTakeEffectAndOldViewsStay) {
  TileMirror mirror;
  mirror.apply(update(mirrored_map, {tile({0, 0}, 3), tile({1, 0}, 4)}));
  const auto before = mirror.snapshot();
  dds::MapIdentity later = mirrored_map;
  later.version = 6;
  mirror.apply(update(later, {}, {tile({1, 0}, 6)}, {{0, 0}}));
  EXPECT_THAT(content(mirror), ElementsAre(std::pair(TileId{1, 0}, 6U)));
  EXPECT_EQ(before->tiles.size(), 2U);
  EXPECT_EQ(before->tiles.back()->info.revision, 4U);
}

TEST(TileMirror, ATileOlderThanTheOneHeldIsLeftOut) {
  TileMirror mirror;
  mirror.apply(update(mirrored_map, {tile({0, 0}, 9)}));
  mirror.apply(update(mirrored_map, {}, {tile({0, 0}, 5)}));
  EXPECT_THAT(content(mirror), ElementsAre(std::pair(TileId{0, 0}, 9U)));
  EXPECT_EQ(mirror.snapshot()->version, 9U);
}

TEST(TileMirror, AnotherMapReplacesEverythingThoughItsVersionsAreSmaller) {
  TileMirror mirror;
  mirror.apply(update(mirrored_map, {tile({0, 0}, 3), tile({1, 0}, 4)}));
  dds::MapIdentity second = mirrored_map;
  second.map_id = 2;
  second.version = 1;
  mirror.apply(update(second, {tile({1, 0}, 1)}));
  EXPECT_THAT(content(mirror), ElementsAre(std::pair(TileId{1, 0}, 1U)));
  EXPECT_EQ(mirror.snapshot()->map_id, 2U);
}

TEST(TileMirror, KnowsWhetherItHoldsWhatTheServerHas) {
  TileMirror mirror;
  mirror.apply(update(mirrored_map, {tile({0, 0}, 3)}));
  EXPECT_TRUE(mirror.holds({mirrored_map, {tile({0, 0}, 2).info}}));
  EXPECT_FALSE(mirror.holds({mirrored_map, {tile({0, 0}, 4).info}}));
  EXPECT_FALSE(mirror.holds({mirrored_map, {tile({1, 0}, 1).info}}));
  dds::MapIdentity second = mirrored_map;
  second.map_id = 2;
  EXPECT_FALSE(mirror.holds({second, {tile({0, 0}, 1).info}}));
}

TEST(TileMirror, WakesWhoWaitsForAChange) {
  TileMirror mirror;
  const auto empty = mirror.snapshot();
  EXPECT_EQ(mirror.wait_for_change(empty, 1ms), empty);
  std::jthread writer([&] { mirror.apply(update(mirrored_map, {tile({0, 0}, 3)})); });
  EXPECT_EQ(mirror.wait_for_change(empty, 30s)->tiles.size(), 1U);
}

}  // namespace
}  // namespace stillmap::cli
