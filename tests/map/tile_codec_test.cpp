#include "core/map/storage/tile_codec.hpp"

#include <gmock/gmock.h>

#include <random>

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

}  // namespace
}  // namespace stillmap
