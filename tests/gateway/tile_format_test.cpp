#include "clients/gateway/tile_format.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cstring>
#include <map>
#include <random>

#include "core/map/voxel_grid.hpp"

namespace stillmap::gateway {
namespace {

constexpr dds::MapIdentity map{.version = 1, .map_id = 2, .tile_size_m = 20.0, .voxel_size_m = 0.2};

Tile random_tile(TileId id, std::size_t voxels) {
  const VoxelGrid grid(map.voxel_size_m, map.tile_size_m);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> in_tile(0.0, map.tile_size_m);
  std::uniform_real_distribution<double> height(-3.0, 12.0);
  std::map<VoxelIndex, Voxel> by_place;
  while (by_place.size() < voxels) {
    const Eigen::Vector3d p_map(id.x * map.tile_size_m + in_tile(random),
                                id.y * map.tile_size_m + in_tile(random), height(random));
    const VoxelGrid::Index index = grid.index(p_map);
    if (index.tile != id) continue;
    Voxel voxel;
    voxel.index = index.voxel;
    voxel.point_count = 3;
    voxel.mean_map = p_map.cast<float>();
    voxel.evidence.add(static_cast<SemanticClass>(1 + random() % 19), 1.0F);
    by_place.emplace(index.voxel, voxel);
  }
  std::vector<Voxel> sorted;
  for (const auto& [key, voxel] : by_place) sorted.push_back(voxel);
  return make_tile(id, 1, sorted, grid);
}

template <typename T>
T number_at(const std::string& bytes, std::size_t at) {
  T value{};
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

TEST(TileFormat, HasEveryVoxelWhereItIsWithItsClass) {
  const TileId id{-2, 3};
  const Tile tile = random_tile(id, 500);
  const std::string bytes = encode_tile(tile, map);
  ASSERT_EQ(bytes.size(), 32 + 8 * tile.voxels.size());
  EXPECT_EQ(bytes.substr(0, 4), "STL1");
  EXPECT_EQ(number_at<std::int32_t>(bytes, 4), id.x);
  EXPECT_EQ(number_at<std::int32_t>(bytes, 8), id.y);
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 12), tile.voxels.size());
  const float min_z_m = number_at<float>(bytes, 24);
  std::size_t found = 0;
  for (const Voxel& voxel : tile.voxels) {
    for (std::size_t at = 32; at < bytes.size(); at += 8) {
      const Eigen::Vector3d p_map(
          id.x * 20.0 + number_at<std::uint16_t>(bytes, at) * 0.025,
          id.y * 20.0 + number_at<std::uint16_t>(bytes, at + 2) * 0.025,
          static_cast<double>(min_z_m) + number_at<std::uint16_t>(bytes, at + 4) * 0.025);
      if ((p_map - voxel.mean_map.cast<double>()).norm() > 0.03) continue;
      if (number_at<std::uint16_t>(bytes, at + 6) ==
          static_cast<std::uint16_t>(voxel.evidence.winner())) {
        ++found;
        break;
      }
    }
  }
  EXPECT_EQ(found, tile.voxels.size());
}

TEST(TileFormat, ItsBeginningIsSpreadOverTheTile) {
  const Tile tile = random_tile({0, 0}, 2000);
  const std::string bytes = encode_tile(tile, map);
  // Of 16 squares, each has its share of the first eighth: 250 / 16 of them.
  std::array<int, 16> counts{};
  for (std::size_t i = 0; i < 250; ++i) {
    const auto x = number_at<std::uint16_t>(bytes, 32 + 8 * i);
    const auto y = number_at<std::uint16_t>(bytes, 34 + 8 * i);
    ++counts[static_cast<std::size_t>(std::min(x / 200, 3) * 4 + std::min(y / 200, 3))];
  }
  EXPECT_THAT(counts, ::testing::Each(::testing::Gt(4)));
}

TEST(TileFormat, AnEmptyTileIsItsHead) { EXPECT_EQ(encode_tile(Tile{}, map).size(), 32U); }

}  // namespace
}  // namespace stillmap::gateway
