#include "core/map/packed_voxels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <random>
#include <ranges>

namespace stillmap {
namespace {

static_assert(std::ranges::random_access_range<const PackedVoxels>);

const VoxelGrid packed_grid(0.2, 20.0);

std::vector<Voxel> row_of(TileId id, int count) {
  std::mt19937_64 random(6);
  std::vector<Voxel> voxels;
  for (int i = 0; i < count; ++i) {
    Voxel& voxel = voxels.emplace_back();
    voxel.index = voxel_index(static_cast<std::uint32_t>(i) * 3U);
    voxel.point_count = 1 + static_cast<std::uint32_t>(random() % 400);
    voxel.mean_map = (packed_grid.corner_map(id, voxel.index).array() + 0.07).cast<float>();
    voxel.evidence.add(SemanticClass::road, 0.5F);
    voxel.first_seen_ns = static_cast<std::int64_t>(random());
    voxel.last_seen_ns = i;
  }
  return voxels;
}

TEST(PackedVoxels, StampsStayExactHoweverManyThereAre) {
  for (const int count : {0, 1, 2, 200, 50'000}) {
    const std::vector<Voxel> voxels = row_of({0, 0}, count);
    const PackedVoxels packed({0, 0}, packed_grid, voxels);
    ASSERT_EQ(packed.size(), voxels.size());
    for (std::size_t i = 0; i < voxels.size(); ++i) {
      EXPECT_EQ(packed[i].first_seen_ns, voxels[i].first_seen_ns);
      EXPECT_EQ(packed[i].last_seen_ns, voxels[i].last_seen_ns);
    }
  }
}

TEST(PackedVoxels, AreReadAtAnyPlace) {
  const PackedVoxels packed({0, 0}, packed_grid, row_of({0, 0}, 100));
  const std::vector<Voxel> all(packed.begin(), packed.end());
  ASSERT_EQ(all.size(), 100U);
  EXPECT_EQ(all[42].index, packed[42].index);
  EXPECT_EQ((packed.begin() + 42)->index, all[42].index);
  EXPECT_EQ(std::ranges::lower_bound(packed, all[42].index, {}, &Voxel::index) - packed.begin(),
            42);
  EXPECT_EQ(packed.first(3).size(), 3U);
  EXPECT_EQ(packed.first(3).back().last_seen_ns, 2);
}

TEST(PackedVoxels, AMeanComesBackAsItWasAtAnyDistance) {
  for (const TileId id : {TileId{0, 0}, TileId{-50, 700}, TileId{4'000, -4'999}}) {
    const PackedVoxels packed(id, packed_grid, row_of(id, 1000));
    const PackedVoxels again(id, packed_grid, std::vector<Voxel>(packed.begin(), packed.end()));
    for (std::size_t i = 0; i < packed.size(); ++i) {
      const Eigen::Vector3f corner = packed_grid.corner_map(id, packed[i].index).cast<float>();
      EXPECT_LT((packed[i].mean_map - corner).cwiseAbs().maxCoeff(), 0.21F);
      EXPECT_TRUE((packed[i].mean_map - again[i].mean_map).cwiseAbs().maxCoeff() <= 4e-4F);
    }
  }
}

TEST(PackedVoxels, ContentTellsTheEighthOfTheMeanForEverySum) {
  PackedVoxel voxel;
  voxel.key = voxel_key({1, 2, 3});
  for (std::uint32_t points = 1; points <= PackedVoxel::max_mean_points; ++points) {
    voxel.point_count = static_cast<std::uint16_t>(points);
    for (std::uint32_t sum = 0; sum <= 255 * points; ++sum) {
      voxel.offset_sum[2] = static_cast<std::uint16_t>(sum);
      ASSERT_EQ(content_word(voxel) >> 5 & 7U, (2 * sum + points) / (64 * points))
          << sum << " of " << points;
    }
  }
}

TEST(PackedVoxels, BoundsAreThoseOfTheMeans) {
  EXPECT_TRUE(PackedVoxels().bounds_map().isEmpty());
  for (const TileId id : {TileId{0, 0}, TileId{-50, 700}, TileId{4'000, -4'999}}) {
    const PackedVoxels packed(id, packed_grid, row_of(id, 1000));
    Eigen::AlignedBox3f bounds;
    for (const Voxel& voxel : packed) bounds.extend(voxel.mean_map);
    EXPECT_EQ(packed.bounds_map().min(), bounds.min());
    EXPECT_EQ(packed.bounds_map().max(), bounds.max());
  }
}

TEST(PackedVoxels, TakeFewBytes) {
  std::vector<Voxel> voxels = row_of({0, 0}, 5000);
  for (Voxel& voxel : voxels) {
    voxel.first_seen_ns %= 50;
    voxel.last_seen_ns %= 50;
  }
  const PackedVoxels packed({0, 0}, packed_grid, voxels);
  EXPECT_LT(static_cast<double>(packed.memory_bytes()) / 5000.0, 22.0);
}

}  // namespace
}  // namespace stillmap
