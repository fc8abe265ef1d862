#include "core/map/tile_evidence.hpp"

#include <gmock/gmock.h>

#include <random>

#include "core/map/storage/tile_codec.hpp"

namespace stillmap {
namespace {

Voxel voxel_at(std::uint16_t x, SemanticClass label) {
  Voxel voxel;
  voxel.index = {x, 7, -3};
  voxel.point_count = 1U + x;
  voxel.mean_map = {0.1F * x, 1.5F, -0.5F};
  voxel.evidence.add(label, 0.75F);
  voxel.first_seen_ns = 5;
  voxel.last_seen_ns = 1'700'000'000'000'000'000;
  return voxel;
}

TileMemory any_memory() {
  TileMemory memory;
  memory.id = {-4, 2'000};
  memory.shown = {{1, 2, true, false}, {65535, 0, true, true}, {3, 1000, false, false}};
  memory.hidden = {
      {voxel_at(1, SemanticClass::car), {4, 5, true, false}, RemovalReason::relabelled},
      {voxel_at(2, SemanticClass::fence), {1, 9, true, false}, RemovalReason::seen_through},
      {voxel_at(200, SemanticClass::pole), {1, 0, false, false}, std::nullopt}};
  memory.excluded = {{{3, 4, 5}, SemanticClass::person, true, 77},
                     {{255, 0, -32768}, SemanticClass::car, false, -1}};
  return memory;
}

TEST(TileMemory, RoundTripLosesNothing) {
  const TileMemory memory = any_memory();
  const TileMemory back = decode_memory(encode_memory(memory));
  EXPECT_EQ(back.id, memory.id);
  EXPECT_EQ(back.shown, memory.shown);
  ASSERT_EQ(back.hidden.size(), memory.hidden.size());
  for (std::size_t i = 0; i < memory.hidden.size(); ++i) {
    EXPECT_EQ(back.hidden[i].voxel.index, memory.hidden[i].voxel.index);
    EXPECT_EQ(back.hidden[i].voxel.mean_map, memory.hidden[i].voxel.mean_map);
    EXPECT_EQ(back.hidden[i].voxel.evidence, memory.hidden[i].voxel.evidence);
    EXPECT_EQ(back.hidden[i].voxel.last_seen_ns, memory.hidden[i].voxel.last_seen_ns);
    EXPECT_EQ(back.hidden[i].past, memory.hidden[i].past);
    EXPECT_EQ(back.hidden[i].reason, memory.hidden[i].reason);
  }
  ASSERT_EQ(back.excluded.size(), memory.excluded.size());
  for (std::size_t i = 0; i < memory.excluded.size(); ++i) {
    EXPECT_EQ(back.excluded[i].index, memory.excluded[i].index);
    EXPECT_EQ(back.excluded[i].label, memory.excluded[i].label);
    EXPECT_EQ(back.excluded[i].was_moving, memory.excluded[i].was_moving);
    EXPECT_EQ(back.excluded[i].last_seen_ns, memory.excluded[i].last_seen_ns);
  }
}

TEST(TileMemory, SaysWhatIsRemovedAndWhy) {
  const auto removed = removed_voxels(any_memory(), 0.2, 20.0);
  std::vector<RemovalReason> reasons;
  for (const RemovedVoxel& voxel : removed) reasons.push_back(voxel.reason);
  EXPECT_THAT(reasons, testing::ElementsAre(RemovalReason::relabelled, RemovalReason::seen_through,
                                            RemovalReason::moving, RemovalReason::semi_static));
  EXPECT_TRUE(removed[2].position_map.isApprox(
      Eigen::Vector3f(-80.0F + 0.7F, 40'000.0F + 0.9F, 1.1F), 1e-6F));
}

TEST(TileMemory, EveryTruncationIsRefused) {
  const auto bytes = encode_memory(any_memory());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW((void)decode_memory(std::span(bytes).first(size)), TileCodecError) << size;
  }
}

TEST(TileMemory, DamagedBytesAreRefused) {
  const auto bytes = encode_memory(any_memory());
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    auto damaged = bytes;
    // The checksum's four bytes at the end may be skipped for none.
    damaged[random() % damaged.size()] ^= static_cast<std::uint8_t>(1U << random() % 8);
    try {
      EXPECT_EQ(decode_memory(damaged).shown, any_memory().shown);
    } catch (const TileCodecError&) {
      continue;
    }
  }
}

}  // namespace
}  // namespace stillmap
