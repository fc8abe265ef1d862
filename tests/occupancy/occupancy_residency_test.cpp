#include <gtest/gtest.h>

#include "core/map/tile_evidence.hpp"
#include "core/occupancy/occupancy_map.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap::test {
namespace {

/// A street of 300 m, observed and cleared along its length.
class PagedStreet : public testing::Test {
 protected:
  PagedStreet() {
    StaticMapConfig config;
    StaticMap street(config);
    for (int k = 0; k < 10; ++k) {
      const LabelledScan scan = street_scan(static_cast<std::uint32_t>(k), 60);
      const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(30.0 * k, 0.0, 0.0));
      map_.insert(scan, T_map_lidar);
      // Twice, so that voxels are published.
      street.insert(scan, T_map_lidar);
      street.insert(scan, T_map_lidar);
    }
    view_ = *street.view();
  }

  /// The view with the tiles before this position evicted.
  [[nodiscard]] MapSnapshot without_tiles_before(double x_map) const {
    MapSnapshot view = view_;
    for (const auto& tile : view_.tiles) {
      const double end_x_map = (tile->info.id.x + 1) * view.tile_size_m;
      if (end_x_map <= x_map) view.tiles.set(without_voxels(*tile));
    }
    return view;
  }
  [[nodiscard]] BoxOccupancy between(double first_x_map, double last_x_map) const {
    const Eigen::Vector3d low(first_x_map, -200.0, -200.0);
    const Eigen::Vector3d high(last_x_map, 200.0, 200.0);
    return map_.in_box({low, high}, 0);
  }

  OccupancyMap map_{OccupancyConfig{}};
  MapSnapshot view_;
};

TEST_F(PagedStreet, EvictsTheColumnsOfNonResidentTilesOnly) {
  const BoxOccupancy ahead = between(150.0, 400.0);
  ASSERT_GT(between(0.0, 100.0).free, 1000U);
  EXPECT_FALSE(map_.sync_residency(view_));
  EXPECT_TRUE(map_.sync_residency(without_tiles_before(140.0)));
  // Columns of 25.6 m that reach into tiles in memory stay.
  EXPECT_EQ(between(-10.0, 100.0).free, 0U);
  EXPECT_EQ(between(-10.0, 100.0).occupied, 0U);
  EXPECT_EQ(between(150.0, 400.0).free, ahead.free);
  EXPECT_EQ(between(150.0, 400.0).occupied, ahead.occupied);
  EXPECT_FALSE(map_.sync_residency(without_tiles_before(140.0))) << "nothing new";
}

TEST_F(PagedStreet, CountsItsNodesCorrectlyAfterEviction) {
  const OccupancySize whole = map_.size();
  map_.sync_residency(without_tiles_before(140.0));
  EXPECT_LT(map_.size().memory_bytes, whole.memory_bytes);
  EXPECT_EQ(map_.size().nodes, OccupancyMap(map_.encode(OctomapEncoding::full)).size().nodes);
}

TEST_F(PagedStreet, InsertsTheVoxelsOfReloadedTilesAsOccupied) {
  map_.sync_residency(without_tiles_before(140.0));
  EXPECT_TRUE(map_.sync_residency(view_));
  std::size_t voxels = 0;
  for (const auto& tile : view_.tiles) {
    if ((tile->info.id.x + 1) * view_.tile_size_m > 100.0) continue;
    for (const Voxel& voxel : tile->voxels) {
      ++voxels;
      ASSERT_EQ(map_.at_point(voxel.mean_map.cast<double>()).occupancy, Occupancy::occupied);
    }
  }
  EXPECT_GT(voxels, 100U);
}

// As the robot comes nearer, ring by ring: a tile shares its columns with one that came before.
TEST_F(PagedStreet, InsertsTilesThatAreReloadedOneAfterTheOther) {
  map_.sync_residency(without_tiles_before(400.0));
  for (const double first_x_map : {300.0, 260.0, 240.0, 200.0, 160.0, 140.0, 100.0, 40.0})
    map_.sync_residency(without_tiles_before(first_x_map));
  map_.sync_residency(view_);
  for (const auto& tile : view_.tiles) {
    for (const Voxel& voxel : tile->voxels)
      ASSERT_EQ(map_.at_point(voxel.mean_map.cast<double>()).occupancy, Occupancy::occupied)
          << "tile " << tile->info.id.x << " " << tile->info.id.y;
  }
}

TEST_F(PagedStreet, TreatsTilesThatWereNeverResidentAsEvicted) {
  OccupancyMap map{OccupancyConfig{}};
  const MapSnapshot stored = without_tiles_before(140.0);
  map.insert(stored);
  EXPECT_TRUE(map.sync_residency(stored));
  EXPECT_TRUE(map.sync_residency(view_));
  const Voxel& voxel = view_.tiles.front()->voxels.front();
  EXPECT_EQ(map.at_point(voxel.mean_map.cast<double>()).occupancy, Occupancy::occupied);
}

}  // namespace
}  // namespace stillmap::test
