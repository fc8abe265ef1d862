#include "core/map/storage/tile_codec.hpp"

#include <gmock/gmock.h>

#include <random>

#include "core/map/tile_evidence.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

std::vector<Tile> street_tiles() {
  const auto view = test::street_map(2, 100).view();
  std::vector<Tile> tiles;
  for (const auto& tile : view->tiles) tiles.push_back(*tile);
  return tiles;
}

void expect_equal(const Voxel& a, const Voxel& b) {
  EXPECT_EQ(a.index, b.index);
  EXPECT_EQ(a.point_count, b.point_count);
  EXPECT_EQ(a.mean_map, b.mean_map);
  EXPECT_EQ(a.evidence, b.evidence);
  EXPECT_EQ(a.first_seen_ns, b.first_seen_ns);
  EXPECT_EQ(a.last_seen_ns, b.last_seen_ns);
}

TEST(TileCodec, RoundTripLosesNothing) {
  for (const Tile& tile : street_tiles()) {
    const Tile back = decode_tile(encode_tile(tile));
    EXPECT_EQ(back.info.id, tile.info.id);
    EXPECT_EQ(back.info.revision, tile.info.revision);
    EXPECT_EQ(back.info.content_hash, tile.info.content_hash);
    EXPECT_EQ(back.info.voxel_count, tile.info.voxel_count);
    EXPECT_TRUE(back.info.bounds_map.isApprox(tile.info.bounds_map, 0.0F));
    ASSERT_EQ(back.voxels.size(), tile.voxels.size());
    for (std::size_t i = 0; i < tile.voxels.size(); ++i) {
      expect_equal(back.voxels[i], tile.voxels[i]);
    }
  }
}

TEST(TileCodec, EmptyTileSurvives) {
  Tile tile;
  tile.info.id = {-5, 7};
  EXPECT_EQ(decode_tile(encode_tile(tile)).info.id, tile.info.id);
}

TEST(TileCodec, EveryTruncationIsRefused) {
  const auto blob = encode_tile(street_tiles().front());
  for (std::size_t size = 0; size < blob.size(); ++size) {
    EXPECT_THROW((void)decode_tile(std::span(blob).first(size)), TileCodecError) << size;
  }
}

TEST(TileCodec, DamagedBytesAreRefused) {
  const auto blob = encode_tile(street_tiles().front());
  std::mt19937 random(5);
  for (int i = 0; i < 3000; ++i) {
    auto damaged = blob;
    damaged[random() % blob.size()] ^= static_cast<std::uint8_t>(1U << random() % 8);
    // One reserved bit of a zstd frame's head may be set without harm; then nothing is lost.
    try {
      EXPECT_EQ(encode_tile(decode_tile(damaged)), blob);
    } catch (const TileCodecError&) {
    }
  }
}

TEST(TileCodec, RandomBytesAreRefused) {
  std::mt19937 random(6);
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::uint8_t> bytes(random() % 200);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    if (!bytes.empty()) bytes[0] = 1;
    EXPECT_THROW((void)decode_tile(bytes), TileCodecError);
  }
}

TEST(TileCodec, AnotherFormatIsNamed) {
  auto blob = encode_tile(street_tiles().front());
  blob[0] = 9;
  EXPECT_THAT([&] { (void)decode_tile(blob); },
              testing::ThrowsMessage<TileCodecError>(testing::HasSubstr("format 9")));
}

TEST(TileCodec, ImpossibleVoxelsAreRefused) {
  const Tile good = street_tiles().front();
  const auto expect_refused = [&](auto spoil) {
    Tile bad = good;
    spoil(bad);
    EXPECT_THROW((void)decode_tile(encode_tile(bad)), TileCodecError);
  };
  expect_refused([](Tile& tile) { tile.voxels[1].index = tile.voxels[0].index; });
  expect_refused([](Tile& tile) { tile.voxels[0].mean_map.x() = NAN; });
  expect_refused([](Tile& tile) { tile.voxels[0].point_count = 0; });
  expect_refused([](Tile& tile) { tile.voxels.back().index.x = 256; });
  expect_refused(
      [](Tile& tile) { tile.voxels[0].evidence.votes[1].label = static_cast<SemanticClass>(200); });
  expect_refused([](Tile& tile) { tile.info.voxel_count += 1; });
  expect_refused([](Tile& tile) { tile.info.voxel_count = 0xFFFFFFFF; });
}

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

TileEvidence any_evidence() {
  TileEvidence evidence;
  evidence.id = {-4, 2'000};
  evidence.shown = {{1, 2, true, false}, {65535, 0, true, true}, {3, 1000, false, false}};
  evidence.hidden = {
      {voxel_at(1, SemanticClass::car), {4, 5, true, false}, RemovalReason::relabelled},
      {voxel_at(2, SemanticClass::fence), {1, 9, true, false}, RemovalReason::seen_through},
      {voxel_at(200, SemanticClass::pole), {1, 0, false, false}, std::nullopt}};
  evidence.excluded = {{{3, 4, 5}, SemanticClass::person, true, 77},
                       {{255, 0, -32768}, SemanticClass::car, false, -1}};
  return evidence;
}

TEST(TileEvidence, RoundTripLosesNothing) {
  const TileEvidence evidence = any_evidence();
  const TileEvidence back = decode_evidence(encode_evidence(evidence));
  EXPECT_EQ(back.id, evidence.id);
  EXPECT_EQ(back.shown, evidence.shown);
  ASSERT_EQ(back.hidden.size(), evidence.hidden.size());
  for (std::size_t i = 0; i < evidence.hidden.size(); ++i) {
    EXPECT_EQ(back.hidden[i].voxel.index, evidence.hidden[i].voxel.index);
    EXPECT_EQ(back.hidden[i].voxel.mean_map, evidence.hidden[i].voxel.mean_map);
    EXPECT_EQ(back.hidden[i].voxel.evidence, evidence.hidden[i].voxel.evidence);
    EXPECT_EQ(back.hidden[i].voxel.last_seen_ns, evidence.hidden[i].voxel.last_seen_ns);
    EXPECT_EQ(back.hidden[i].history, evidence.hidden[i].history);
    EXPECT_EQ(back.hidden[i].reason, evidence.hidden[i].reason);
  }
  ASSERT_EQ(back.excluded.size(), evidence.excluded.size());
  for (std::size_t i = 0; i < evidence.excluded.size(); ++i) {
    EXPECT_EQ(back.excluded[i].index, evidence.excluded[i].index);
    EXPECT_EQ(back.excluded[i].label, evidence.excluded[i].label);
    EXPECT_EQ(back.excluded[i].was_moving, evidence.excluded[i].was_moving);
    EXPECT_EQ(back.excluded[i].last_seen_ns, evidence.excluded[i].last_seen_ns);
  }
}

TEST(TileEvidence, SaysWhatIsRemovedAndWhy) {
  const auto removed = removed_voxels(any_evidence(), 0.2, 20.0);
  std::vector<RemovalReason> reasons;
  for (const RemovedVoxel& voxel : removed) reasons.push_back(voxel.reason);
  EXPECT_THAT(reasons, testing::ElementsAre(RemovalReason::relabelled, RemovalReason::seen_through,
                                            RemovalReason::moving, RemovalReason::semi_static));
  EXPECT_TRUE(removed[2].position_map.isApprox(
      Eigen::Vector3f(-80.0F + 0.7F, 40'000.0F + 0.9F, 1.1F), 1e-6F));
}

TEST(TileEvidence, EveryTruncationIsRefused) {
  const auto bytes = encode_evidence(any_evidence());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW((void)decode_evidence(std::span(bytes).first(size)), TileCodecError) << size;
  }
}

TEST(TileEvidence, DamagedBytesAreRefused) {
  const auto bytes = encode_evidence(any_evidence());
  std::mt19937 random(5);
  for (int i = 0; i < 2000; ++i) {
    auto damaged = bytes;
    // The checksum's four bytes at the end may be skipped for none.
    damaged[random() % damaged.size()] ^= static_cast<std::uint8_t>(1U << random() % 8);
    try {
      EXPECT_EQ(decode_evidence(damaged).shown, any_evidence().shown);
    } catch (const TileCodecError&) {
      continue;
    }
  }
}

}  // namespace
}  // namespace stillmap
