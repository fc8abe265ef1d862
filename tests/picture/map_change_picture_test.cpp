#include "core/picture/map_change_picture.hpp"

#include <gmock/gmock.h>

#include <map>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "core/map/voxel_grid.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;

/// Column and row to the class of a voxel at height 0.
using Cells = std::map<std::pair<std::uint16_t, std::uint16_t>, SemanticClass>;

MapSnapshot view_of(const Cells& cells) {
  const VoxelGrid grid(0.5, 16.0);
  std::vector<Voxel> voxels;
  for (const auto& [cell, label] : cells) {
    Voxel voxel;
    voxel.index = {cell.first, cell.second, 0};
    voxel.point_count = 1;
    voxel.mean_map = (grid.corner_map({0, 0}, voxel.index).array() + 0.25).matrix().cast<float>();
    voxel.evidence.add(label, 1.0F);
    voxels.push_back(voxel);
  }
  return {.version = 1,
          .map_id = 1,
          .tile_size_m = 16.0,
          .voxel_size_m = 0.5,
          .tiles = {std::make_shared<const Tile>(make_tile({0, 0}, 1, voxels, grid))}};
}

/// Names of the strong colours in a picture.
std::set<std::string> colours_in(const std::filesystem::path& file) {
  const cv::Mat3b picture = cv::imread(file.string());
  std::set<std::string> colours;
  for (const cv::Vec3b& p : picture) {
    if (p[1] > 150 && p[2] < 100) colours.insert("green");
    if (p[1] < 100 && p[2] > 200) colours.insert("red");
    if (p[1] > 180 && p[2] > 200 && p[0] < 80) colours.insert("yellow");
    if (p[0] > 200 && p[2] < 100) colours.insert("blue");
  }
  return colours;
}

TEST(MapChangePicture, HasEveryKindOfChangeInItsColour) {
  const ScratchFolder folder;
  Cells before;
  Cells after;
  for (std::uint16_t x = 0; x < 10; ++x) {
    before[{x, 0}] = after[{x, 0}] = road;
    before[{x, 10}] = fence;
    after[{x, 20}] = pole;
    before[{x, 30}] = terrain;
    after[{x, 30}] = vegetation;
  }
  const MapSnapshot a = view_of(before);
  const MapSnapshot b = view_of(after);
  write_diff_picture(folder / "diff.png", a, b, diff_maps(a, b), 400);
  EXPECT_THAT(colours_in(folder / "diff.png"), testing::ElementsAre("green", "red", "yellow"));
  EXPECT_THROW(write_diff_picture(folder / "no" / "diff.png", a, b, diff_maps(a, b)),
               std::runtime_error);
}

TEST(MapChangePicture, HasEveryReasonOfARemovalInItsColour) {
  const ScratchFolder folder;
  const MapSnapshot view = view_of({{{0, 0}, road}, {{9, 9}, road}});
  std::vector<RemovedVoxel> removed;
  for (int reason = 0; reason < removal_reason_count; ++reason) {
    removed.push_back({.position_map = {static_cast<float>(reason), 2.0F, 0.0F},
                       .reason = static_cast<RemovalReason>(reason)});
  }
  write_removed_picture(folder / "removed.png", view, removed, 400);
  EXPECT_THAT(colours_in(folder / "removed.png"),
              testing::ElementsAre("blue", "green", "red", "yellow"));
}

}  // namespace
}  // namespace stillmap
