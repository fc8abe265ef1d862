#include "core/map/query/tile_reader.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <random>
#include <thread>
#include <vector>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

const VoxelGrid grid(0.2, 20.0);

/// A tile of which all places have the same voxels.
Tile level_tile(TileId id, std::uint64_t revision, std::uint16_t voxels) {
  std::vector<Voxel> row;
  for (std::uint16_t i = 0; i < voxels; ++i) {
    Voxel voxel;
    voxel.index = {i, 0, 0};
    voxel.point_count = 3;
    voxel.mean_map = (grid.corner_map(id, voxel.index).array() + 0.1).cast<float>();
    voxel.evidence.add(SemanticClass::road, 0.5F);
    row.push_back(voxel);
  }
  return make_tile(id, revision, std::move(row), grid);
}

/// Makes up the tiles it is asked for, of `voxels` voxels, and counts how often.
class LevelTiles : public TileStore {
 public:
  TileRecord load(TileId id) override {
    ++loads;
    return {std::make_shared<const Tile>(level_tile(id, revision, voxels)), nullptr};
  }
  [[nodiscard]] std::shared_ptr<const Tile> stub(TileId id) const {
    return without_voxels(level_tile(id, revision, voxels));
  }

  std::atomic<int> loads = 0;
  std::uint64_t revision = 1;
  std::uint16_t voxels = 50;
};

constexpr std::size_t plenty_bytes = std::size_t{16} << 20;

TEST(TileReader, ReadsEachStateOfATileOnce) {
  const auto store = std::make_shared<LevelTiles>();
  TileReader reader(store, plenty_bytes);
  const auto first = store->stub({1, -2});
  EXPECT_EQ(reader.read(first)->voxels.size(), 50U);
  EXPECT_EQ(reader.read(first)->voxels.size(), 50U);
  EXPECT_EQ(store->loads, 1);

  store->revision = 2;
  store->voxels = 51;
  EXPECT_EQ(reader.read(store->stub({1, -2}))->voxels.size(), 51U);
  EXPECT_EQ(reader.read(first)->voxels.size(), 50U) << "a page of an older view";
  EXPECT_EQ(store->loads, 2);
}

TEST(TileReader, SaysThatATileChangedThatItDoesNotHave) {
  const auto store = std::make_shared<LevelTiles>();
  TileReader reader(store, plenty_bytes);
  const auto first = store->stub({0, 0});
  store->revision = 2;
  EXPECT_THROW(static_cast<void>(reader.read(first)), TileChanged);
}

TEST(TileReader, TellsPlacesWithTheSameContentApart) {
  const auto store = std::make_shared<LevelTiles>();
  TileReader reader(store, plenty_bytes);
  for (int round = 0; round < 2; ++round) {
    for (int x = -20; x < 20; ++x) {
      for (int y = -20; y < 20; ++y) {
        const TileId id{x, y};
        ASSERT_EQ(reader.read(store->stub(id))->info.id, id);
      }
    }
  }
  EXPECT_EQ(store->loads, 1600);
}

TEST(TileReader, KeepsToItsBytesAndDropsWhatWasUsedLongestAgo) {
  const auto store = std::make_shared<LevelTiles>();
  constexpr std::size_t cache_bytes = 100'000;
  TileReader reader(store, cache_bytes);
  const auto often = store->stub({-1, 0});
  static_cast<void>(reader.read(often));
  for (int x = 0; x < 1000; ++x) {
    static_cast<void>(reader.read(store->stub({x, 0})));
    static_cast<void>(reader.read(often));
  }
  EXPECT_EQ(store->loads, 1001);
  static_cast<void>(reader.read(store->stub({999, 0})));
  EXPECT_EQ(store->loads, 1001) << "among the last";
  static_cast<void>(reader.read(store->stub({0, 0})));
  EXPECT_EQ(store->loads, 1002) << "long ago";
}

TEST(TileReader, ForgetsTheTilesOfTheStoreBefore) {
  const auto store = std::make_shared<LevelTiles>();
  TileReader reader(store, plenty_bytes);
  static_cast<void>(reader.read(store->stub({3, 3})));
  const auto other = std::make_shared<LevelTiles>();
  reader.use_tile_store(other);
  static_cast<void>(reader.read(store->stub({3, 3})));
  EXPECT_EQ(other->loads, 1);
}

TEST(TileReader, ThreadsReadAtOnce) {
  const auto store = std::make_shared<LevelTiles>();
  constexpr std::size_t some_tiles_bytes = 50'000;
  TileReader reader(store, some_tiles_bytes);
  std::atomic<int> wrong = 0;
  {
    std::vector<std::jthread> threads;
    for (unsigned seed = 0; seed < 4; ++seed) {
      threads.emplace_back([&, seed] {
        std::mt19937 random(seed);
        for (int i = 0; i < 2000; ++i) {
          const TileId id{static_cast<int>(random() % 60), 0};
          if (reader.read(store->stub(id))->info.id != id) ++wrong;
        }
      });
    }
  }
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace stillmap
