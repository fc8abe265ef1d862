#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

#include "core/map/storage/byte_planes.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/map/storage/tile_frame.hpp"
#include "core/map/tile_evidence.hpp"

namespace stillmap {
namespace {

// What programs wrote that knew the first format alone: every field as it was in memory.

const VoxelGrid first_grid(0.2, 20.0);
constexpr TileId first_id{-3, 40};

struct FirstVoxel {
  VoxelIndex index;
  std::uint32_t point_count = 3;
  Eigen::Vector3f mean_map = Eigen::Vector3f::Zero();
  std::array<ClassEvidence::Vote, 3> votes{};
  std::int64_t first_seen_ns = 0;
  std::int64_t last_seen_ns = 0;
};

constexpr std::size_t voxel_bytes = 53;
constexpr auto visit_voxel = [](auto&& visit, const FirstVoxel& voxel) {
  visit(voxel.index.x);
  visit(voxel.index.y);
  visit(voxel.index.z);
  visit(voxel.point_count);
  for (int axis = 0; axis < 3; ++axis) visit(voxel.mean_map[axis]);
  for (const auto& vote : voxel.votes) {
    visit(vote.label);
    visit(vote.weight);
  }
  visit(voxel.first_seen_ns);
  visit(voxel.last_seen_ns);
};

template <typename Field>
void append(PlaneBytes& content, const Field& field) {
  const std::size_t end = content.bytes.size();
  content.bytes.resize(end + sizeof(field));
  FieldWriter(content.bytes.data() + end)(field);
}

std::vector<std::uint8_t> first_tile(const std::vector<FirstVoxel>& voxels) {
  PlaneBytes content;
  append(content, first_id.x);
  append(content, first_id.y);
  append(content, std::uint64_t{12});
  append(content, std::uint64_t{34});
  append(content, static_cast<std::uint32_t>(voxels.size()));
  append_planes<voxel_bytes>(content, voxels, visit_voxel);
  return to_frame(1, content);
}

/// Means and weights at random, also where rounding might take the mean to another eighth of the
/// voxel, or another class to the top.
std::vector<FirstVoxel> any_voxels() {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> offset(0.0, 1.0);
  std::vector<FirstVoxel> voxels;
  for (std::uint16_t x = 0; x < 100; ++x) {
    for (std::uint16_t y = 0; y < 20; ++y) {
      FirstVoxel& voxel = voxels.emplace_back();
      voxel.index = {x, y, static_cast<std::int16_t>(x - y)};
      voxel.point_count = 1U << x % 20;
      Eigen::Vector3d at(offset(random), offset(random), offset(random));
      if (y % 4 == 0) at = (at * 8.0).array().round() / 8.0;
      voxel.mean_map = (first_grid.corner_map(first_id, voxel.index) + 0.2 * at).cast<float>();
      const auto weight = static_cast<float>(offset(random));
      voxel.votes = {{{SemanticClass::road, weight},
                      {SemanticClass::pole, weight * (1.0F + 1e-6F)},
                      {SemanticClass::unlabeled, 0.0F}}};
      voxel.first_seen_ns = 1'000'000'007LL * x;
      voxel.last_seen_ns = voxel.first_seen_ns - y;
    }
  }
  return voxels;
}

/// An eighth of a voxel, as the first format's hash had it.
Eigen::Vector3i eighth(const Eigen::Vector3f& mean_map, VoxelIndex index) {
  const Eigen::Vector3d offset =
      (mean_map.cast<double>() - first_grid.corner_map(first_id, index)) / 0.2;
  return (offset * 8).array().floor().cwiseMax(0.0).cwiseMin(7.0).cast<int>();
}

TEST(FirstTileFormat, IsReadAndWhatAClientSeesStays) {
  const std::vector<FirstVoxel> voxels = any_voxels();
  const Tile tile = decode_tile(first_tile(voxels), first_grid);
  EXPECT_EQ(tile.info.id, first_id);
  EXPECT_EQ(tile.info.revision, 12U);
  EXPECT_EQ(tile.info.content_hash, 34U);
  ASSERT_EQ(tile.voxels.size(), voxels.size());
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    const Voxel voxel = tile.voxels[i];
    EXPECT_EQ(voxel.index, voxels[i].index);
    EXPECT_EQ(voxel.point_count, std::min(voxels[i].point_count, 65'535U));
    EXPECT_LT((voxel.mean_map - voxels[i].mean_map).cwiseAbs().maxCoeff(), 5e-4F);
    const std::uint64_t mean = content_word(tile.voxels.packed()[i]) >> 5 & 0x1FFU;
    const Eigen::Vector3i was = eighth(voxels[i].mean_map, voxels[i].index);
    EXPECT_EQ(mean, static_cast<std::uint64_t>((was.x() * 8 + was.y()) * 8 + was.z()));
    const bool pole_won = voxels[i].votes[1].weight > voxels[i].votes[0].weight;
    EXPECT_EQ(voxel.evidence.winner(), pole_won ? SemanticClass::pole : SemanticClass::road);
    EXPECT_EQ(voxel.first_seen_ns, voxels[i].first_seen_ns);
    EXPECT_EQ(voxel.last_seen_ns, voxels[i].last_seen_ns);
  }
  const Tile again = decode_tile(encode_tile(tile), first_grid);
  EXPECT_TRUE(std::ranges::equal(again.voxels.packed(), tile.voxels.packed()));
}

TEST(FirstTileFormat, ImpossibleVoxelsAreRefused) {
  const auto expect_refused = [](auto spoil) {
    std::vector<FirstVoxel> voxels = any_voxels();
    spoil(voxels);
    EXPECT_THROW((void)decode_tile(first_tile(voxels), first_grid), TileCodecError);
  };
  using Voxels = std::vector<FirstVoxel>&;
  expect_refused([](Voxels voxels) { voxels[1].index = voxels[0].index; });
  expect_refused([](Voxels voxels) { voxels[0].mean_map.x() = NAN; });
  expect_refused([](Voxels voxels) { voxels[0].mean_map.x() += 0.5F; });
  expect_refused([](Voxels voxels) { voxels[0].point_count = 0; });
  expect_refused([](Voxels voxels) { voxels.back().index.x = 256; });
  expect_refused([](Voxels voxels) { voxels[0].votes[1].label = static_cast<SemanticClass>(200); });
  expect_refused([](Voxels voxels) { voxels[0].votes[1].weight = -1.0F; });
}

TEST(FirstTileFormat, EvidenceIsRead) {
  std::vector<FirstVoxel> hidden = any_voxels();
  hidden.resize(3);
  PlaneBytes content;
  append(content, first_id.x);
  append(content, first_id.y);
  append(content, std::uint32_t{1});
  append(content, std::uint32_t{3});
  append(content, std::uint32_t{1});
  const auto visit_history = [](auto&& visit, const VoxelHistory& history) {
    visit(history.hits);
    visit(history.misses);
    visit(static_cast<std::uint8_t>((history.was_shown ? 1 : 0) + (history.is_restored ? 2 : 0)));
  };
  const VoxelHistory history{7, 999, true, false};
  append_planes<5>(content, std::vector{history}, visit_history);
  append_planes<voxel_bytes + 6>(content, hidden, [&](auto&& visit, const FirstVoxel& voxel) {
    visit_voxel(visit, voxel);
    visit_history(visit, history);
    visit(static_cast<std::uint8_t>(voxel.index.y == 0 ? 255 : voxel.index.y));
  });
  const ExcludedVoxel excluded{{3, 4, -5}, SemanticClass::person, true, -77};
  append_planes<16>(content, std::vector{excluded}, [](auto&& visit, const ExcludedVoxel& voxel) {
    visit(voxel.index.x);
    visit(voxel.index.y);
    visit(voxel.index.z);
    visit(voxel.label);
    visit(static_cast<std::uint8_t>(voxel.was_moving ? 1 : 0));
    visit(voxel.last_seen_ns);
  });
  const TileEvidence evidence = decode_evidence(to_frame(1, content), first_grid);
  EXPECT_EQ(evidence.id, first_id);
  EXPECT_EQ(evidence.shown, std::vector{history});
  EXPECT_EQ(evidence.excluded, std::vector{excluded});
  ASSERT_EQ(evidence.hidden.size(), 3U);
  EXPECT_EQ(evidence.hidden[2].index, hidden[2].index);
  EXPECT_EQ(evidence.hidden[2].last_seen_ns, hidden[2].last_seen_ns);
  EXPECT_EQ(evidence.hidden_states[0], (HiddenState{history, std::nullopt}));
  EXPECT_EQ(evidence.hidden_states[2], (HiddenState{history, RemovalReason::seen_through}));
}

}  // namespace
}  // namespace stillmap
