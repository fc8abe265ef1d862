#include "core/map/tile_lookup.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <random>

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
  EXPECT_EQ(tile_versions(*view, everywhere).size(), view->tiles.size());
  EXPECT_TRUE(tile_versions(*view, AlignedBox3d()).empty());
  AlignedBox3d no_number = everywhere;
  no_number.min().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(tile_versions(*view, no_number).empty());
  EXPECT_TRUE(tile_versions(MapSnapshot{}, everywhere).empty());
}

TEST(TileLookup, FindsTilesByIdAndLeavesOutUnknownOnes) {
  const auto view = test::street_map(1, 100).view();
  const TileId known = view->tiles.back()->info.id;
  const std::vector<TileId> ids{{1000, 1000}, known, {-1000, 3}, view->tiles.front()->info.id};
  EXPECT_THAT(find_tiles(*view, ids),
              testing::ElementsAre(view->tiles.back(), view->tiles.front()));
  EXPECT_TRUE(find_tiles(MapSnapshot{}, ids).empty());
}

}  // namespace
}  // namespace stillmap
