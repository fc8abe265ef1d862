#include "core/map/tile_table.hpp"

#include <gmock/gmock.h>

#include <map>
#include <random>

#include "core/map/tile.hpp"

namespace stillmap {
namespace {

using Tiles = std::map<TileId, TileTable::SharedTile>;

TileTable::SharedTile tile_of(TileId id, std::uint64_t revision, std::uint32_t voxels = 0) {
  Tile tile;
  tile.info.id = id;
  tile.info.revision = revision;
  tile.info.voxel_count = voxels;
  return std::make_shared<const Tile>(std::move(tile));
}

Tiles contents(const TileTable& table) {
  Tiles tiles;
  for (const auto& tile : table) tiles[tile->info.id] = tile;
  EXPECT_EQ(tiles.size(), table.size());
  return tiles;
}

/// Random edits of tiles in a square, applied to the map as well.
std::vector<TileTable::Edit> random_edits(std::mt19937& random, int side, Tiles& tiles,
                                          std::uint64_t revision) {
  std::uniform_int_distribution<int> index(0, side - 1);
  std::map<TileId, TileTable::SharedTile> edits;
  const int count = std::uniform_int_distribution<int>(1, 60)(random);
  const bool removes = random() % 3 == 0;
  for (int i = 0; i < count; ++i) {
    const TileId id{index(random), index(random)};
    edits[id] = removes && i % 2 == 0 ? nullptr : tile_of(id, revision);
  }
  std::vector<TileTable::Edit> sorted;
  for (const auto& [id, tile] : edits) {
    sorted.push_back({id, tile});
    if (tile) tiles[id] = tile;
    if (!tile) tiles.erase(id);
  }
  return sorted;
}

TEST(TileTable, AgreesWithAMapUnderRandomEdits) {
  std::mt19937 random(3);
  for (const int side : {3, 20, 60}) {
    TileTable table;
    Tiles expected;
    for (std::uint64_t revision = 1; revision < 150; ++revision) {
      const TileTable before = table;
      const Tiles expected_before = expected;
      table = table.with(random_edits(random, side, expected, revision));
      ASSERT_EQ(contents(table), expected);
      ASSERT_EQ(contents(before), expected_before) << "a table never changes";
      Tiles patched = expected_before;
      TileTable::for_each_difference(before, table, [&](const auto& old, const auto& now) {
        ASSERT_NE(old, now);
        const TileId id = (old ? old : now)->info.id;
        ASSERT_EQ(old, expected_before.contains(id) ? expected_before.at(id) : nullptr);
        patched.erase(id);
        if (now) patched[id] = now;
      });
      ASSERT_EQ(patched, expected);
    }
  }
}

TEST(TileTable, FindsTilesByIdPositionAndRevision) {
  std::mt19937 random(4);
  TileTable table;
  Tiles expected;
  for (std::uint64_t revision = 1; revision < 60; ++revision) {
    table = table.with(random_edits(random, 40, expected, revision));
  }
  std::size_t position = 0;
  for (const auto& [id, tile] : expected) {
    ASSERT_EQ(table.find(id), tile);
    ASSERT_EQ(table[position], tile);
    ASSERT_EQ(table.lower_bound(id).position(), position);
    ++position;
  }
  EXPECT_EQ(table.find({-1, 0}), nullptr);
  EXPECT_EQ(table.find({100, 0}), nullptr);
  EXPECT_EQ(table.lower_bound({100, 0}), table.end());
  EXPECT_EQ(table.lower_bound({-1, 0}), table.begin());
  std::size_t newer = 0;
  table.for_each_newer(50, [&](const auto& tile) {
    EXPECT_GT(tile->info.revision, 50U);
    ++newer;
  });
  EXPECT_EQ(newer, std::ranges::count_if(expected, [](const auto& entry) {
              return entry.second->info.revision > 50;
            }));
}

TEST(TileTable, AChangeCostsItsPiecesAndNotTheMap) {
  std::vector<TileTable::SharedTile> tiles;
  for (int x = 0; x < 100; ++x) {
    for (int y = 0; y < 100; ++y) tiles.push_back(tile_of({x, y}, 1));
  }
  const TileTable table{tiles};
  TileTable changed = table;
  changed.set(tile_of({50, 50}, 2));
  // Tiles of pieces that both share have the same place in memory.
  std::size_t moved = 0;
  for (auto a = table.begin(), b = changed.begin(); a != table.end(); ++a, ++b) {
    if (&*a != &*b) ++moved;
  }
  EXPECT_GT(moved, 0U);
  EXPECT_LE(moved, TileTable::max_piece_tiles);
}

TEST(TileTable, CountsVoxelsAndTilesWithoutThem) {
  TileTable table;
  EXPECT_TRUE(table.empty());
  EXPECT_EQ(table.begin(), table.end());
  table.set(tile_of({0, 0}, 1, 7));
  table.set(tile_of({0, 1}, 1, 0));
  EXPECT_EQ(table.voxel_count(), 7U);
  EXPECT_EQ(table.non_resident_count(), 1U) << "it has 7 voxels, and none of them here";
  table.erase({0, 0});
  EXPECT_EQ(table.voxel_count(), 0U);
  table.erase({0, 1});
  EXPECT_TRUE(table.empty());
  EXPECT_EQ(table, TileTable());
}

}  // namespace
}  // namespace stillmap
