#include "core/map/storage/tile_codec.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <random>
#include <span>
#include <vector>

#include "core/map/storage/packed_codec.hpp"
#include "core/map/storage/tile_frame.hpp"
#include "core/map/tile_evidence.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

const VoxelGrid codec_grid(0.2, 20.0);

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
    const Tile back = decode_tile(encode_tile(tile), codec_grid);
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

/// Of all that a voxel can be.
PackedVoxel any_voxel(std::uint32_t key, std::mt19937& random) {
  const auto up_to = [&](std::uint32_t most) {
    return static_cast<std::uint16_t>(
        std::uniform_int_distribution<std::uint32_t>(0, most)(random));
  };
  PackedVoxel voxel;
  voxel.key = key;
  voxel.point_count = static_cast<std::uint16_t>(1U + up_to(up_to(1) == 0 ? 4U : 65'534U));
  for (auto& sum : voxel.offset_sum)
    sum = up_to((PackedVoxel::offset_steps - 1) * voxel.mean_points());
  ClassEvidence::Bits evidence;
  std::uint32_t left = ClassEvidence::max_steps;
  for (std::size_t i = 0; i < evidence.weights.size(); ++i) {
    left -= evidence.weights[i] = up_to(left);
    evidence.classes =
        static_cast<std::uint16_t>(evidence.classes | up_to(semantic_class_count - 1) << (5 * i));
  }
  voxel.evidence = ClassEvidence::of(evidence).value();
  return voxel;
}

TEST(TileCodec, AnyVoxelsComeBackHoweverMany) {
  std::mt19937 random(19);
  for (const std::size_t count : {1U, 63U, 64U, 65U, 128U, 5'000U}) {
    std::vector<PackedVoxel> voxels;
    SeenTimes seen{{-7, 6'000'000'000}, {}};
    std::uint32_t key = 0;
    for (std::size_t i = 0; i < count; ++i) {
      key += 1 + (static_cast<std::uint32_t>(random()) >> random() % 14 >> 13);
      voxels.push_back(any_voxel(key, random));
      for (int k = 0; k < 2; ++k) seen.stamp_of.push_back(static_cast<std::uint32_t>(random() % 2));
    }
    const Tile tile = make_tile({3, -4}, 9, PackedVoxels({3, -4}, codec_grid, voxels, seen));
    const Tile back = decode_tile(encode_tile(tile), codec_grid);
    EXPECT_TRUE(std::ranges::equal(back.voxels.packed(), voxels)) << count;
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(back.voxels.first_stamp(i), seen.stamp_of[2 * i]);
      EXPECT_EQ(back.voxels.last_stamp(i), seen.stamp_of[2 * i + 1]);
    }
  }
}

TEST(TileCodec, EmptyTileSurvives) {
  Tile tile;
  tile.info.id = {-5, 7};
  EXPECT_EQ(decode_tile(encode_tile(tile), codec_grid).info.id, tile.info.id);
}

TEST(TileCodec, EveryTruncationIsRefused) {
  const auto blob = encode_tile(street_tiles().front());
  for (std::size_t size = 0; size < blob.size(); ++size) {
    EXPECT_THROW((void)decode_tile(std::span(blob).first(size), codec_grid), TileCodecError)
        << size;
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
      EXPECT_EQ(encode_tile(decode_tile(damaged, codec_grid)), blob);
    } catch (const TileCodecError&) {
    }
  }
}

TEST(TileCodec, RandomBytesAreRefused) {
  std::mt19937 random(6);
  for (int i = 0; i < 2000; ++i) {
    std::vector<std::uint8_t> bytes(random() % 200);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    if (!bytes.empty())
      bytes[0] = tile_formats.at(static_cast<std::size_t>(i) % tile_formats.size());
    EXPECT_THROW((void)decode_tile(bytes, codec_grid), TileCodecError);
  }
}

TEST(TileCodec, AnotherFormatIsNamed) {
  auto blob = encode_tile(street_tiles().front());
  blob[0] = 9;
  EXPECT_THAT([&] { (void)decode_tile(blob, codec_grid); },
              testing::ThrowsMessage<TileCodecError>(testing::HasSubstr("format 9")));
}

TEST(TileCodec, ImpossibleVoxelsAreRefused) {
  const Tile good = street_tiles().front();
  const auto expect_refused = [&](auto spoil) {
    std::vector<PackedVoxel> voxels(good.voxels.packed().begin(), good.voxels.packed().end());
    SeenTimes seen{{5}, std::vector<std::uint32_t>(2 * voxels.size())};
    TileInfo info = good.info;
    spoil(voxels, seen, info);
    const Tile bad{info, PackedVoxels(info.id, codec_grid, voxels, seen)};
    EXPECT_THROW((void)decode_tile(encode_tile(bad), codec_grid), TileCodecError);
  };
  using Voxels = std::vector<PackedVoxel>&;
  using Seen = SeenTimes&;
  using Info = TileInfo&;
  expect_refused([](Voxels voxels, Seen, Info) { voxels[1].key = voxels[0].key; });
  ASSERT_GT(good.voxels.size(), 64U);
  for (const std::size_t at : {std::size_t{0}, good.voxels.size() - 1}) {
    expect_refused([&](Voxels voxels, Seen, Info) { voxels[at].offset_sum[1] = 65'535; });
    expect_refused([&](Voxels voxels, Seen, Info) { voxels[at].point_count = 0; });
  }
  expect_refused([](Voxels voxels, Seen, Info) { std::swap(voxels.end()[-1], voxels.end()[-2]); });
  expect_refused([](Voxels, Seen seen, Info) { seen.stamps_ns = {6, 5}; });
  expect_refused([](Voxels, Seen seen, Info) { seen.stamps_ns = {}; });
  expect_refused([](Voxels voxels, Seen seen, Info) {
    for (std::size_t i = 0; i < 2 * voxels.size(); ++i) {
      seen.stamps_ns.push_back(static_cast<std::int64_t>(6 + i));
    }
  });
  expect_refused([](Voxels, Seen, Info info) { info.voxel_count += 1; });
  expect_refused([](Voxels, Seen, Info info) { info.voxel_count = 0xFFFFFFFF; });
  EXPECT_FALSE(ClassEvidence::of(ClassEvidence::Bits{{1, 0, 0}, 31}));
  EXPECT_FALSE(ClassEvidence::of(ClassEvidence::Bits{{20'000, 20'000, 0}, 1}));
}

/// An encoded tile or evidence as the second format stores it: with its voxels' first votes as they
/// are. Their planes begin at `voxels_at` of the content.
std::vector<std::uint8_t> in_second_format(const std::vector<std::uint8_t>& encoded,
                                           std::size_t voxels_at,
                                           std::span<const PackedVoxel> all) {
  constexpr std::size_t first_votes_at = 2 * 2 + 3 + 3 + 2;
  std::vector<std::uint8_t> content = from_frame(encoded, 1);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const std::uint16_t weight = all[i].evidence.bits().weights[0];
    const std::size_t low = voxels_at + first_votes_at * all.size() + i;
    content[low] = static_cast<std::uint8_t>(weight & 0xFFU);
    content[low + all.size()] = static_cast<std::uint8_t>(weight >> 8);
  }
  return to_frame(2, {content, {}});
}

TEST(TileCodec, TheSecondFormatIsRead) {
  for (const Tile& tile : street_tiles()) {
    constexpr std::size_t header_bytes = 42;
    const auto second = in_second_format(
        encode_tile(tile), header_bytes + stamp_bytes * tile.voxels.stamps_ns().size(),
        tile.voxels.packed());
    const Tile back = decode_tile(second, codec_grid);
    EXPECT_TRUE(std::ranges::equal(back.voxels.packed(), tile.voxels.packed()));
    EXPECT_EQ(encode_tile(back), encode_tile(tile));
  }
}

TEST(TileCodec, ATileOfOtherSizesThanItsMapIsRefused) {
  const auto blob = encode_tile(street_tiles().front());
  EXPECT_THROW((void)decode_tile(blob, {0.1, 10.0}), TileCodecError);
  EXPECT_THROW((void)decode_tile(blob, {0.2, 10.0}), TileCodecError);
}

TEST(TileCodec, KeysOfAnyOrderComeBack) {
  std::mt19937 random(8);
  KeySteps there;
  KeySteps back;
  for (int i = 0; i < 10'000; ++i) {
    const auto key = static_cast<std::uint32_t>(random()) >> random() % 17;
    EXPECT_EQ(back.key_at(there.step_to(key)), key);
  }
}

constexpr TileId evidence_tile{-4, 2'000};

Voxel voxel_at(std::uint16_t x, SemanticClass label) {
  Voxel voxel;
  voxel.index = {x, 7, -3};
  voxel.point_count = 1U + x;
  voxel.mean_map = (codec_grid.corner_map(evidence_tile, voxel.index).array() + 0.13).cast<float>();
  voxel.evidence.add(label, 0.75F);
  voxel.first_seen_ns = 1'700'000'000'000'000'000;
  voxel.last_seen_ns = 5 + x;
  return voxel;
}

TileEvidence any_evidence() {
  TileEvidence evidence;
  evidence.id = evidence_tile;
  evidence.shown = {{1, 2, true, false}, {65535, 0, true, true, true}, {3, 1000, false, false}};
  evidence.hidden =
      PackedVoxels(evidence_tile, codec_grid,
                   std::array{voxel_at(1, SemanticClass::car), voxel_at(2, SemanticClass::fence),
                              voxel_at(90, SemanticClass::pole)});
  evidence.hidden_states = {{{4, 5, true, false}, RemovalReason::relabelled},
                            {{1, 9, true, false}, RemovalReason::seen_through},
                            {{1, 0, false, false}, std::nullopt}};
  evidence.excluded = {{{3, 4, 5}, SemanticClass::person, true, 77},
                       {{255, 0, -32768}, SemanticClass::car, false, -1}};
  return evidence;
}

TEST(TileEvidence, RoundTripLosesNothing) {
  const TileEvidence evidence = any_evidence();
  const TileEvidence back = decode_evidence(encode_evidence(evidence), codec_grid);
  EXPECT_EQ(back.id, evidence.id);
  EXPECT_EQ(back.shown, evidence.shown);
  ASSERT_EQ(back.hidden.size(), evidence.hidden.size());
  for (std::size_t i = 0; i < evidence.hidden.size(); ++i) {
    expect_equal(back.hidden[i], evidence.hidden[i]);
  }
  EXPECT_EQ(back.hidden_states, evidence.hidden_states);
  EXPECT_EQ(back.excluded, evidence.excluded);
}

TEST(TileCodec, OnlyEvidenceOfThinThingsNeedsTheirFormat) {
  TileEvidence evidence = any_evidence();
  std::vector<std::uint8_t> bytes = encode_evidence(evidence);
  EXPECT_EQ(bytes[0], thin_evidence_format);
  bytes[0] = tile_format;
  EXPECT_THROW((void)decode_evidence(bytes, codec_grid), TileCodecError);
  for (VoxelHistory& history : evidence.shown) history.is_thin = false;
  // As programs read that know no thin things.
  EXPECT_EQ(encode_evidence(evidence)[0], tile_format);
  evidence.hidden_states[0].history.is_thin = true;
  EXPECT_EQ(encode_evidence(evidence)[0], thin_evidence_format);
}

TEST(TileEvidence, TheSecondFormatIsRead) {
  TileEvidence evidence = any_evidence();
  for (VoxelHistory& history : evidence.shown) history.is_thin = false;
  constexpr std::size_t header_bytes = 38;
  constexpr std::size_t shown_bytes = 5;
  const std::size_t voxels_at = header_bytes + shown_bytes * evidence.shown.size() +
                                stamp_bytes * evidence.hidden.stamps_ns().size();
  const auto second =
      in_second_format(encode_evidence(evidence), voxels_at, evidence.hidden.packed());
  const TileEvidence back = decode_evidence(second, codec_grid);
  EXPECT_TRUE(std::ranges::equal(back.hidden.packed(), evidence.hidden.packed()));
  EXPECT_EQ(encode_evidence(back), encode_evidence(evidence));
}

TEST(TileEvidence, SaysWhatIsRemovedAndWhy) {
  const auto removed = removed_voxels(any_evidence(), 0.2, 20.0);
  std::vector<RemovalReason> reasons;
  reasons.reserve(removed.size());
  for (const RemovedVoxel& voxel : removed) reasons.push_back(voxel.reason);
  EXPECT_THAT(reasons, testing::ElementsAre(RemovalReason::relabelled, RemovalReason::seen_through,
                                            RemovalReason::moving, RemovalReason::semi_static));
  EXPECT_TRUE(removed[2].position_map.isApprox(
      Eigen::Vector3f(-80.0F + 0.7F, 40'000.0F + 0.9F, 1.1F), 1e-6F));
}

TEST(TileEvidence, EveryTruncationIsRefused) {
  const auto bytes = encode_evidence(any_evidence());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW((void)decode_evidence(std::span(bytes).first(size), codec_grid), TileCodecError)
        << size;
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
      EXPECT_EQ(decode_evidence(damaged, codec_grid).shown, any_evidence().shown);
    } catch (const TileCodecError&) {
      continue;
    }
  }
}

}  // namespace
}  // namespace stillmap
