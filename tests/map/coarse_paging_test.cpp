// Coarser answers of regions that are much larger than a page.
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <random>
#include <set>
#include <tuple>

#include "core/map/query/map_query.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

/// Holds tiles, and counts how often one is asked for.
class CountingTileStore : public TileStore {
 public:
  explicit CountingTileStore(const TileTable& tiles) : tiles_(tiles) {}
  TileRecord load(TileId id) override {
    ++loads;
    return {tiles_.find(id), nullptr};
  }
  std::atomic<std::size_t> loads = 0;

 private:
  TileTable tiles_;
};

/// A map of `side` by `side` tiles with some voxels each, on both sides of the origin.
MapSnapshot wide_map(int side) {
  const VoxelGrid grid(0.2, 20.0);
  std::mt19937 random(2);
  std::uniform_int_distribution<int> column(0, 99);
  std::vector<std::shared_ptr<const Tile>> tiles;
  for (int x = -side / 2; x < side / 2; ++x) {
    for (int y = -side / 2; y < side / 2; ++y) {
      std::map<VoxelIndex, Voxel> voxels;
      for (int i = 0; i < 30; ++i) {
        Voxel voxel;
        voxel.index = {static_cast<std::uint16_t>(column(random)),
                       static_cast<std::uint16_t>(column(random)),
                       static_cast<std::int16_t>(column(random) % 10)};
        voxel.point_count = 1 + static_cast<std::uint32_t>(column(random));
        voxel.mean_map = (grid.corner_map({x, y}, voxel.index).array() + 0.1).cast<float>();
        voxel.evidence.add(SemanticClass::road, 0.5F);
        voxels[voxel.index] = voxel;
      }
      std::vector<Voxel> sorted;
      sorted.reserve(voxels.size());
      for (const auto& [index, voxel] : voxels) sorted.push_back(voxel);
      tiles.push_back(std::make_shared<const Tile>(make_tile({x, y}, 1, std::move(sorted), grid)));
    }
  }
  MapSnapshot map{.version = 1, .map_id = 7, .tile_size_m = 20.0, .voxel_size_m = 0.2, .tiles = {}};
  map.tiles = TileTable(std::move(tiles));
  return map;
}

MapSnapshot on_disk(const MapSnapshot& map) {
  std::vector<std::shared_ptr<const Tile>> stubs;
  stubs.reserve(map.tiles.size());
  for (const auto& tile : map.tiles) stubs.push_back(without_voxels(*tile));
  MapSnapshot away = map;
  away.tiles = TileTable(std::move(stubs));
  return away;
}

using Cell = std::tuple<int, int, int>;

std::map<Cell, std::uint64_t> points_by_cell(const MapSnapshot& map, double resolution_m) {
  std::map<Cell, std::uint64_t> points;
  for (const auto& tile : map.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      const Eigen::Vector3i cell =
          (voxel.mean_map.cast<double>() / resolution_m).array().floor().cast<int>();
      points[{cell.x(), cell.y(), cell.z()}] += voxel.point_count;
    }
  }
  return points;
}

TEST(CoarsePaging, RowsOfCellsThatAreMadeOfAWholeCityAreRefused) {
  MapQuery query;
  query.resolution_m = 10'000.0;
  const MapSnapshot map = wide_map(100);
  const auto store = std::make_shared<CountingTileStore>(map.tiles);
  TileReader reader(store, 1 << 20);
  const MapQueryResult answer = query_map(on_disk(map), query, nullptr, reader);
  EXPECT_EQ(answer.status, QueryStatus::invalid_request);
  EXPECT_NE(answer.reason.find("finer resolution_m"), std::string::npos) << answer.reason;
  EXPECT_EQ(store->loads, 0U);
}

TEST(CoarsePaging, PagesTogetherAreTheMergedMapWhateverTheirSize) {
  const MapSnapshot map = wide_map(30);
  for (const double resolution_m : {0.5, 0.73, 7.0, 33.0, 500.0}) {
    const auto expected = points_by_cell(map, resolution_m);
    for (const std::uint32_t page_voxels : {700U, 100'000U}) {
      MapQuery query;
      query.resolution_m = resolution_m;
      query.max_bytes = static_cast<std::uint32_t>(page_voxels * query_voxel_bytes);
      auto next = expected.begin();
      do {
        const MapQueryResult page = query_map(map, query);
        ASSERT_EQ(page.status, QueryStatus::ok) << page.reason;
        ASSERT_EQ(page.total_voxels, expected.size());
        for (const QueryVoxel& voxel : page.voxels) {
          ASSERT_NE(next, expected.end());
          ASSERT_EQ(voxel.point_count, (next++)->second) << resolution_m;
        }
        query.continuation = page.continuation;
      } while (!query.continuation.empty());
      EXPECT_EQ(next, expected.end());
    }
  }
}

TEST(CoarsePaging, APageMergesItsOwnPartOfTheRegion) {
  const MapSnapshot map = wide_map(60);
  const auto store = std::make_shared<CountingTileStore>(map.tiles);
  TileReader reader(store, 0);
  const MapSnapshot away = on_disk(map);
  MapQuery query;
  query.resolution_m = 0.5;
  query.max_bytes = 3000 * query_voxel_bytes;
  int pages = 0;
  std::size_t most = 0;
  do {
    const std::size_t before = store->loads;
    const MapQueryResult page = query_map(away, query, nullptr, reader);
    ASSERT_EQ(page.status, QueryStatus::ok) << page.reason;
    if (pages++ > 0) most = std::max(most, store->loads - before);
    query.continuation = page.continuation;
  } while (!query.continuation.empty());
  EXPECT_GT(pages, 20);
  EXPECT_LT(most, 400U) << "of 3600 tiles";
  // Once to count, once to page, and the strips that a page begins or ends in.
  EXPECT_LT(store->loads, 5U * map.tiles.size());
}

TEST(CoarsePaging, NoPageMergesWholeCities) {
  const MapSnapshot map = wide_map(60);
  const auto store = std::make_shared<CountingTileStore>(map.tiles);
  TileReader reader(store, 0);
  // As full as tiles of real streets are.
  constexpr std::uint32_t said_voxels = 3000;
  MapSnapshot away = map;
  std::vector<std::shared_ptr<const Tile>> stubs;
  stubs.reserve(map.tiles.size());
  for (const auto& tile : map.tiles) {
    auto stub = std::make_shared<Tile>(*without_voxels(*tile));
    stub->info.voxel_count = said_voxels;
    stubs.push_back(std::move(stub));
  }
  away.tiles = TileTable(std::move(stubs));
  MapQuery query;
  query.resolution_m = 0.5;
  query.max_bytes = 8'000'000;
  const std::size_t cells = points_by_cell(map, query.resolution_m).size();
  std::size_t voxels = 0;
  int pages = 0;
  do {
    const std::size_t before = store->loads;
    const MapQueryResult page = query_map(away, query, nullptr, reader);
    ASSERT_EQ(page.status, QueryStatus::ok) << page.reason;
    EXPECT_EQ(page.total_voxels, said_voxels * map.tiles.size()) << "an upper bound";
    // A million voxels, and the rest of a strip with what reaches into it.
    EXPECT_LT(store->loads - before, 333U + 3U * 64U);
    voxels += page.voxels.size();
    ++pages;
    query.continuation = page.continuation;
  } while (!query.continuation.empty());
  EXPECT_EQ(voxels, cells);
  EXPECT_GT(pages, 5);
}

TEST(MapQuery, SomeVoxelsOfEachOfTooManyTilesAreRefused) {
  const auto stub = without_voxels(*wide_map(2).tiles.front());
  std::vector<std::shared_ptr<const Tile>> stubs;
  stubs.reserve(std::size_t{101} * 100);
  for (int x = 0; x < 101; ++x) {
    for (int y = 0; y < 100; ++y) {
      auto tile = std::make_shared<Tile>(*stub);
      tile->info.id = {x, y};
      const Eigen::Vector3f corner(20.0F * static_cast<float>(x), 20.0F * static_cast<float>(y),
                                   0.0F);
      tile->info.bounds_map = {corner, corner + Eigen::Vector3f::Constant(19.0F)};
      stubs.push_back(std::move(tile));
    }
  }
  MapSnapshot map{.version = 1, .map_id = 7, .tile_size_m = 20.0, .voxel_size_m = 0.2, .tiles = {}};
  map.tiles = TileTable(std::move(stubs));
  TileReader reader(std::make_shared<CountingTileStore>(map.tiles), 0);
  MapQuery query;
  const Eigen::Vector3d far = Eigen::Vector3d::Constant(1e5);
  query.region = BoxRegion{{-far, far}};
  query.classes.set(static_cast<std::size_t>(SemanticClass::pole));
  const MapQueryResult refused = query_map(map, query, nullptr, reader);
  EXPECT_EQ(refused.status, QueryStatus::invalid_request);
  EXPECT_NE(refused.reason.find("10100 tiles"), std::string::npos) << refused.reason;
}

}  // namespace
}  // namespace stillmap
