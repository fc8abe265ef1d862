#include "core/occupancy/octree_update.hpp"

#include <gtest/gtest.h>
#include <octomap/OcTree.h>

#include <random>
#include <set>
#include <sstream>

namespace stillmap::test {
namespace {

std::string encoded(const octomap::OcTree& octree) {
  std::ostringstream out;
  octree.writeData(out);
  return std::move(out).str();
}

/// Voxels in clumps, so that leaves are pruned and opened again.
std::vector<VoxelKey> random_voxels(std::mt19937& generator) {
  std::uniform_int_distribution<int> corner(-2, 1);
  std::uniform_int_distribution<int> size(1, 9);
  const VoxelKey first(octree_origin + 8 * corner(generator), octree_origin + 8 * corner(generator),
                       octree_origin);
  const VoxelKey extent(size(generator), size(generator), size(generator));
  std::vector<VoxelKey> voxels;
  for (int x = 0; x < extent.x(); ++x) {
    for (int y = 0; y < extent.y(); ++y) {
      for (int z = 0; z < extent.z(); ++z) voxels.push_back(first + VoxelKey(x, y, z));
    }
  }
  return voxels;
}

TEST(OctreeUpdate, EqualsOctoMapsOwnUpdateVoxelByVoxel) {
  std::mt19937 generator(5);
  octomap::OcTree batched(0.2);
  octomap::OcTree single(0.2);
  VoxelBricks bricks;
  for (int round = 0; round < 200; ++round) {
    bricks.clear();
    // Long runs of one kind, so that voxels reach the clamping thresholds.
    const bool hit = round / 20 % 2 == 0;
    for (const VoxelKey& voxel : random_voxels(generator)) {
      VoxelBrick& brick = bricks.brick_of(voxel);
      (hit ? brick.hits : brick.misses) |= VoxelBricks::bit_of(voxel);
      single.updateNode(octomap::OcTreeKey(static_cast<octomap::key_type>(voxel.x()),
                                           static_cast<octomap::key_type>(voxel.y()),
                                           static_cast<octomap::key_type>(voxel.z())),
                        hit);
    }
    update_octree(batched, bricks.sorted(), {batched.getProbHitLog(), batched.getProbMissLog()});
    ASSERT_EQ(encoded(batched), encoded(single)) << "round " << round;
    ASSERT_EQ(batched.size(), batched.calcNumNodes());
  }
}

TEST(OctreeUpdate, OfNothingMakesNothing) {
  octomap::OcTree octree(0.2);
  VoxelBricks bricks;
  bricks.brick_of(VoxelKey::Constant(octree_origin)).ray_ends = 1;
  update_octree(octree, bricks.sorted(), {1.0F, -1.0F});
  EXPECT_EQ(octree.getRoot(), nullptr);
}

TEST(VoxelBricks, AreSortedAsTheOctreeAndHitsTakePrecedence) {
  VoxelBricks bricks;
  for (const auto& voxel : {VoxelKey(65535, 65535, 65535), VoxelKey(4, 0, 0), VoxelKey(0, 4, 0),
                            VoxelKey(0, 0, 4), VoxelKey(0, 0, 0)}) {
    bricks.brick_of(voxel).hits = 1;
    bricks.brick_of(voxel).misses = 3;
  }
  const auto sorted = bricks.sorted();
  ASSERT_EQ(sorted.size(), 5U);
  const std::vector<std::uint64_t> orders{0, 1, 2, 4, (std::uint64_t{1} << 42U) - 1};
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    EXPECT_EQ(sorted[i].order, orders[i]);
    EXPECT_EQ(sorted[i].misses, 2U);
  }
}

}  // namespace
}  // namespace stillmap::test
