#include "core/occupancy/octree_encoding.hpp"

#include <gtest/gtest.h>
#include <octomap/OcTree.h>

#include <random>
#include <sstream>

#include "core/occupancy/octomap_data.hpp"
#include "core/occupancy/octree_parts.hpp"
#include "core/occupancy/octree_update.hpp"

namespace stillmap::test {
namespace {

constexpr double resolution_m = 0.1;

/// A point within `reach_m` of the origin, or of a place far from it.
octomap::point3d any_point(std::mt19937& random, float reach_m) {
  std::uniform_real_distribution<float> within(-reach_m, reach_m);
  const float away = random() % 4 == 0 ? 300.0F : 0.0F;
  return {within(random) + away, within(random), within(random)};
}

/// Columns in both directions, the first at the origin.
OctreeColumn column_at(std::int32_t index) {
  const std::int32_t at = octree_origin / OctreeColumn::side_voxels + index;
  return {at, at};
}

/// Bodies that OctoMap prunes, single voxels, and free space.
octomap::OcTree any_octree(std::uint32_t seed) {
  std::mt19937 random(seed);
  octomap::OcTree octree(resolution_m);
  for (int x = 0; x < 40; ++x) {
    for (int y = 0; y < 40; ++y) {
      for (int z = 0; z < 16; ++z) {
        const bool is_occupied = x >= 16 || z >= 8;
        octree.setNodeValue(octomap::point3d(0.1F * static_cast<float>(x) + 0.05F,
                                             0.1F * static_cast<float>(y) + 0.05F,
                                             0.1F * static_cast<float>(z) + 0.05F),
                            is_occupied ? 2.0F : -1.0F);
      }
    }
  }
  for (int i = 0; i < 2000; ++i) octree.updateNode(any_point(random, 10.0F), random() % 3 == 0);
  return octree;
}

std::string as_octomap_writes_it(const octomap::OcTree& octree, OctomapEncoding encoding) {
  std::ostringstream out;
  if (encoding == OctomapEncoding::binary) {
    octomap::OcTree max_likelihood(octree);
    max_likelihood.toMaxLikelihood();
    max_likelihood.prune();
    max_likelihood.writeBinaryData(out);
  } else {
    octree.writeData(out);
  }
  return std::move(out).str();
}

class OctreeEncoding : public testing::TestWithParam<OctomapEncoding> {};

TEST_P(OctreeEncoding, IsThatOfOctoMapByteForByte) {
  for (std::uint32_t seed = 0; seed < 5; ++seed) {
    const octomap::OcTree octree = any_octree(seed);
    EXPECT_EQ(encode_octree(octree, GetParam()), as_octomap_writes_it(octree, GetParam()));
  }
  const octomap::OcTree empty(resolution_m);
  EXPECT_EQ(encode_octree(empty, GetParam()), as_octomap_writes_it(empty, GetParam()));
}

TEST_P(OctreeEncoding, IsSoundWhateverChangesInItsPauses) {
  for (std::uint32_t seed = 0; seed < 5; ++seed) {
    std::mt19937 random(seed);
    octomap::OcTree octree = any_octree(seed);
    const auto change = [&] {
      switch (random() % 4) {
        case 0:
          octree.updateNode(any_point(random, 10.0F), true);
          break;
        case 1:
          evict_columns(octree, {column_at(static_cast<std::int32_t>(random() % 3) - 1)});
          break;
        case 2:
          octree.prune();
          break;
        default:
          if (random() % 50 == 0) octree.clear();
      }
    };
    const std::string bytes = encode_octree(octree, GetParam(), change);
    const OctomapCheck check =
        check_octomap({.encoding = GetParam(), .resolution_m = resolution_m, .bytes = bytes});
    EXPECT_EQ(check.fault, "") << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(BothKinds, OctreeEncoding,
                         testing::Values(OctomapEncoding::full, OctomapEncoding::binary),
                         [](const auto& kind) {
                           return kind.param == OctomapEncoding::binary ? "binary" : "full";
                         });

TEST(OctreePart, IsFoundAsTheOctreeIsNow) {
  octomap::OcTree octree(resolution_m);
  EXPECT_EQ(node_of(octree, OctreePart()), nullptr);
  const octomap::point3d place(0.05F, 0.05F, 0.05F);
  octree.updateNode(place, true);
  octree.updateNode(octomap::point3d(50.05F, 0.05F, 0.05F), false);
  const OctreeParts found =
      parts_of(octree, VoxelKey::Constant(octree_origin), VoxelKey::Constant(octree_origin + 31));
  ASSERT_EQ(found.parts.size(), 1U);
  const OctreePart part = found.parts.front();
  EXPECT_EQ(part.side, OctreePart::usual_side);
  EXPECT_EQ(part.corner, VoxelKey::Constant(octree_origin));
  EXPECT_EQ(found.nodes_above, 11U);
  ASSERT_NE(node_of(octree, part), nullptr);
  EXPECT_TRUE(octree.isNodeOccupied(node_of(octree, part)));
  evict_columns(octree, {column_at(0)});
  EXPECT_EQ(node_of(octree, part), nullptr);
}

}  // namespace
}  // namespace stillmap::test
