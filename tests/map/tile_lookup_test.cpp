#include <gmock/gmock.h>

#include <limits>
#include <random>

#include "core/map/voxel_grid.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(TileLookup, AgreesWithBruteForceOnRandomBoxes) {
  const auto view = test::street_map(5, 200).view();
  std::mt19937 random(11);
  std::uniform_real_distribution<double> coordinate(-80.0, 80.0);
  for (int i = 0; i < 500; ++i) {
    AlignedBox3d box;
    for (int corner = 0; corner < 2; ++corner) {
      box.extend(Vector3d(coordinate(random), coordinate(random), coordinate(random)));
    }
    std::vector<std::size_t> expected;
    for (std::size_t t = 0; t < view->tiles.size(); ++t) {
      if (box.intersects(view->tiles[t]->info.bounds_map.cast<double>())) expected.push_back(t);
    }
    EXPECT_EQ(tiles_in_box(*view, box), expected);
  }
}

TEST(TileLookup, WholeWorldIsEveryTileAndNonsenseIsNone) {
  const auto view = test::street_map(1, 100).view();
  const AlignedBox3d everywhere(Vector3d::Constant(-infinity), Vector3d::Constant(infinity));
  EXPECT_EQ(tiles_in_box(*view, everywhere).size(), view->tiles.size());
  EXPECT_TRUE(tiles_in_box(*view, AlignedBox3d()).empty());
  AlignedBox3d no_number = everywhere;
  no_number.min().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(tiles_in_box(*view, no_number).empty());
  EXPECT_TRUE(tiles_in_box(MapSnapshot{}, everywhere).empty());
}

TEST(TileLookup, FindsTilesById) {
  const auto view = test::street_map(1, 100).view();
  for (const auto& tile : view->tiles) EXPECT_EQ(find_tile(*view, tile->info.id), tile);
  EXPECT_EQ(find_tile(*view, {1000, 1000}), nullptr);
  EXPECT_EQ(find_tile(*view, {-1000, 3}), nullptr);
  EXPECT_EQ(find_tile(MapSnapshot{}, {0, 0}), nullptr);
}

}  // namespace
}  // namespace stillmap
