#include "core/map/tools/map_diff.hpp"

#include <gmock/gmock.h>

#include <map>
#include <random>

#include "core/map/voxel_grid.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using testing::HasSubstr;

constexpr double voxel_size_m = 0.5;
constexpr double tile_size_m = 4.0;
constexpr int columns = 8;

/// Cell of the whole map.
using Cell = std::array<int, 3>;
using Cells = std::map<Cell, SemanticClass>;

MapSnapshot view_of(const Cells& cells) {
  const VoxelGrid grid(voxel_size_m, tile_size_m);
  std::map<TileId, std::vector<Voxel>> voxels;
  for (const auto& [cell, label] : cells) {
    const Eigen::Vector3d centre =
        (Eigen::Vector3d(cell[0], cell[1], cell[2]) + Eigen::Vector3d::Constant(0.5)) *
        voxel_size_m;
    const VoxelGrid::Index index = grid.index(centre);
    Voxel voxel;
    voxel.index = index.voxel;
    voxel.point_count = 1;
    voxel.mean_map = centre.cast<float>();
    voxel.evidence.add(label, 1.0F);
    voxels[index.tile].push_back(voxel);
  }
  MapSnapshot view{.version = 1,
                   .map_id = 1,
                   .tile_size_m = tile_size_m,
                   .voxel_size_m = voxel_size_m,
                   .tiles = {}};
  for (auto& [id, tile] : voxels) {
    std::ranges::sort(tile, {}, &Voxel::index);
    view.tiles.set(std::make_shared<const Tile>(make_tile(id, 1, tile, grid)));
  }
  return view;
}

Cells random_cells(std::uint32_t seed, int count) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> place(-10, 10);
  std::uniform_int_distribution<int> label(0, 3);
  Cells cells;
  for (int i = 0; i < count; ++i) {
    cells[{place(random), place(random), place(random) / 2}] =
        static_cast<SemanticClass>(12 + label(random));
  }
  return cells;
}

/// The definition, cell by cell: 'k'ept, 'g'one, 'r'elabelled, with the class that it then is.
std::pair<char, SemanticClass> plain_fate(const Cell& cell, SemanticClass label, const Cells& other,
                                          int reach) {
  std::pair<char, SemanticClass> fate{'g', SemanticClass::unlabeled};
  std::array<int, 4> nearest{};
  for (const auto& [far, far_label] : other) {
    const Cell d{far[0] - cell[0], far[1] - cell[1], far[2] - cell[2]};
    if (std::max({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])}) > reach) continue;
    if (far_label == label) return {'k', label};
    const std::array<int, 4> order{d[0] * d[0] + d[1] * d[1] + d[2] * d[2], d[0], d[1], d[2]};
    if (fate.first == 'g' || order < nearest) {
      nearest = order;
      fate = {'r', far_label};
    }
  }
  return fate;
}

TileId tile_of(const Cell& cell) {
  const auto down = [](int value) { return (value >= 0 ? value : value - columns + 1) / columns; };
  return {down(cell[0]), down(cell[1])};
}

/// What diff_maps should find, by the definition.
MapDiff plain_diff(const Cells& before, const Cells& after, int reach) {
  MapDiff diff;
  std::map<TileId, DifferenceCounts> tiles;
  const auto count = [&](const Cell& cell, SemanticClass label, VoxelChange change) {
    diff.counts.add(change);
    diff.classes.at(static_cast<std::size_t>(label)).counts.add(change);
    tiles[tile_of(cell)].add(change);
  };
  for (const auto& [cell, label] : before) {
    ++diff.classes.at(static_cast<std::size_t>(label)).voxels_before;
    const auto [fate, now] = plain_fate(cell, label, after, reach);
    if (fate == 'g') count(cell, label, VoxelChange::gone);
    if (fate != 'r') continue;
    count(cell, label, VoxelChange::relabelled);
    ++diff.relabelled[{label, now}];
  }
  for (const auto& [cell, label] : after) {
    ++diff.classes.at(static_cast<std::size_t>(label)).voxels_after;
    if (plain_fate(cell, label, before, reach).first == 'g') {
      count(cell, label, VoxelChange::appeared);
    }
  }
  for (const auto& [id, counts] : tiles) diff.tiles.push_back({id, counts});
  return diff;
}

void expect_same(const MapDiff& found, const MapDiff& expected) {
  EXPECT_EQ(found.counts, expected.counts);
  EXPECT_EQ(found.relabelled, expected.relabelled);
  for (std::size_t k = 0; k < semantic_class_count; ++k) {
    EXPECT_EQ(found.classes.at(k).counts, expected.classes.at(k).counts) << k;
    EXPECT_EQ(found.classes.at(k).voxels_before, expected.classes.at(k).voxels_before) << k;
    EXPECT_EQ(found.classes.at(k).voxels_after, expected.classes.at(k).voxels_after) << k;
  }
  ASSERT_EQ(found.tiles.size(), expected.tiles.size());
  for (std::size_t i = 0; i < found.tiles.size(); ++i) {
    EXPECT_EQ(found.tiles[i].id, expected.tiles[i].id);
    EXPECT_EQ(found.tiles[i].counts, expected.tiles[i].counts);
  }
}

TEST(MapDiff, AgreesWithThePlainDefinitionAcrossTheBordersOfTiles) {
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    const Cells before = random_cells(seed, 300);
    const Cells after = random_cells(seed + 100, 300);
    for (const int reach : {0, 1, 2}) {
      const MapDiff found = diff_maps(view_of(before), view_of(after), {.tolerance_voxels = reach});
      expect_same(found, plain_diff(before, after, reach));
      EXPECT_EQ(found.voxels.size(), found.counts.sum());
      EXPECT_GT(found.counts.relabelled, 0U);
    }
  }
}

TEST(MapDiff, AMapDoesNotDifferFromItself) {
  const MapSnapshot view = view_of(random_cells(5, 200));
  EXPECT_EQ(diff_maps(view, view, {.tolerance_voxels = 0}).counts.sum(), 0U);
  EXPECT_EQ(diff_maps(MapSnapshot(), MapSnapshot()).counts.sum(), 0U);
}

TEST(MapDiff, AgainstNothingEverythingAppearsOrIsGone) {
  const MapSnapshot view = view_of(random_cells(5, 200));
  const MapDiff all_new = diff_maps(MapSnapshot(), view);
  const MapDiff all_gone = diff_maps(view, MapSnapshot());
  EXPECT_EQ(all_new.counts.appeared, all_new.counts.sum());
  EXPECT_EQ(all_gone.counts.gone, all_new.counts.appeared);
  EXPECT_EQ(all_gone.counts.sum(), all_gone.counts.gone);
}

TEST(MapDiff, ASurfaceThatMovedByOneCellIsTheSame) {
  Cells before;
  Cells after;
  for (int x = 0; x < 12; ++x) {
    before[{x, 0, 0}] = SemanticClass::building;
    after[{x, 1, 0}] = SemanticClass::building;
  }
  EXPECT_EQ(diff_maps(view_of(before), view_of(after)).counts.sum(), 0U);
  EXPECT_EQ(diff_maps(view_of(before), view_of(after), {.tolerance_voxels = 0}).counts.sum(), 24U);
}

TEST(MapDiff, RefusesMapsThatCannotBeCompared) {
  const MapSnapshot view = view_of(random_cells(5, 20));
  MapSnapshot coarse = view;
  coarse.voxel_size_m *= 2.0;
  const auto compare = [&] { static_cast<void>(diff_maps(view, coarse)); };
  EXPECT_THAT(message_of<std::invalid_argument>(compare),
              testing::AllOf(HasSubstr("0.5"), HasSubstr("1.0"), HasSubstr("same static_map")));
  for (const int tolerance : {-1, 6}) {
    EXPECT_THROW(static_cast<void>(diff_maps(view, view, {.tolerance_voxels = tolerance})),
                 std::invalid_argument);
  }
}

}  // namespace
}  // namespace stillmap
