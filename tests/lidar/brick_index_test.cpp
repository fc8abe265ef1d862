#include "core/lidar/brick_index.hpp"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <tuple>

namespace stillmap {
namespace {

using Voxel = std::tuple<int, int, int>;

/// Voxels on both sides of the origin with a number each, in an index and in a plain map.
struct Numbered {
  Numbered() {
    std::mt19937 random(3);
    std::uniform_int_distribution<int> coordinate(-9, 9);
    for (std::uint32_t number = 0; number < 800; ++number) {
      const Voxel voxel{coordinate(random), coordinate(random), coordinate(random)};
      const auto place = place_of(voxel);
      index.number(index.brick_at(place.brick_key), place.cell) = number;
      plain[voxel] = number;
    }
  }
  static BrickIndex::Part place_of(const Voxel& voxel) {
    const auto [x, y, z] = voxel;
    return BrickIndex::place(x, y, z);
  }
  void expect_equal() const {
    for (int x = -14; x <= 14; ++x)
      for (int y = -14; y <= 14; ++y)
        for (int z = -14; z <= 14; ++z) {
          const auto known = plain.find({x, y, z});
          const std::uint32_t expected = known == plain.end() ? BrickIndex::none : known->second;
          ASSERT_EQ(index.number(BrickIndex::place(x, y, z)), expected)
              << x << ' ' << y << ' ' << z;
        }
  }
  BrickIndex index;
  std::map<Voxel, std::uint32_t> plain;
};

TEST(BrickIndex, NumbersVoxelsAsAPlainMapDoes) { Numbered().expect_equal(); }

TEST(BrickIndex, ErasesWhatIsAskedForInTheBricksThatAreLookedAt) {
  Numbered numbered;
  // Lowest voxels of bricks are multiples of 4, 4 and 2.
  numbered.index.erase_if([](int x, int, int z) { return x < 0 && z == 4; },
                          [](std::uint32_t number) { return number % 2 == 0; });
  std::erase_if(numbered.plain, [](const auto& entry) {
    const auto [x, y, z] = entry.first;
    return x < 0 && z >= 4 && z < 6 && entry.second % 2 == 0;
  });
  numbered.expect_equal();
}

TEST(BrickIndex, UsesBricksAgainThatAreEmpty) {
  Numbered numbered;
  const std::size_t bytes = numbered.index.memory_bytes();
  numbered.index.erase_if([](int, int, int) { return true; }, [](std::uint32_t) { return true; });
  const auto place = BrickIndex::place(500, -500, 7);
  const std::uint32_t brick = numbered.index.brick_at(place.brick_key);
  EXPECT_EQ(numbered.index.number(brick, place.cell), BrickIndex::none);
  numbered.index.number(brick, place.cell) = 5;
  numbered.plain.clear();
  numbered.expect_equal();
  EXPECT_EQ(numbered.index.number(place), 5U);
  EXPECT_LE(numbered.index.memory_bytes(), bytes + sizeof(std::uint32_t) * 1024);
}

TEST(UnpackedIndex, IsWhatWasPacked) {
  for (const int x : {-1048576, -3, 0, 5, 1048575})
    for (const int y : {-700, -1, 0, 1048575})
      for (const int z : {-1048576, -1, 0, 9})
        EXPECT_EQ(unpacked_index(packed_index(x, y, z)), (std::array<int, 3>{x, y, z}));
}

}  // namespace
}  // namespace stillmap
