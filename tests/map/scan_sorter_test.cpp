#include "core/map/scan_sorter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <utility>
#include <vector>

namespace stillmap {
namespace {

constexpr double max_range_m = 60.0;
const VoxelGrid grid(0.2, 20.0);

/// Points all round, some of them beyond the range, one that is NaN, with labels and motion.
LabelledScan scattered_points(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> along(-45.0F, 45.0F);
  std::uniform_int_distribution<int> any(0, 19);
  LabelledScan scan;
  for (std::size_t i = 0; i < count; ++i) {
    scan.scan.points_lidar.emplace_back(along(random), along(random), along(random) / 4.0F);
    scan.labels.classes.push_back(static_cast<SemanticClass>(any(random)));
    scan.labels.confidence.push_back(static_cast<float>(any(random)) / 20.0F);
    scan.motion.push_back(static_cast<Motion>(any(random) % 3));
  }
  scan.scan.points_lidar[count / 2].x() = std::numeric_limits<float>::quiet_NaN();
  return scan;
}

/// Whether it lies so near a voxel's face, or the end of the range, that rounding decides.
bool is_on_border(const VoxelGrid::Index& index, const Eigen::Vector3f& point_lidar) {
  constexpr double rounding = 1e-6;
  const Eigen::Array3d parts = index.offset * PackedVoxel::offset_steps;
  return ((parts - parts.round()).abs() < rounding * PackedVoxel::offset_steps).any() ||
         std::abs(point_lidar.norm() - max_range_m) < 1e-4;
}

TEST(ScanSorter, PlacesEveryPointWhereTheGridHasIt) {
  // Not a multiple of what is placed at once.
  const LabelledScan scan = scattered_points(10'007, 1);
  const Eigen::Isometry3d T_map_lidar = Eigen::Translation3d(-13.7, 1234.5, 1.7) *
                                        Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) *
                                        Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX());
  std::map<std::pair<int, int>, std::vector<std::size_t>> expected;
  std::vector<bool> on_border(scan.scan.size());
  for (std::size_t i = 0; i < scan.scan.size(); ++i) {
    const Eigen::Vector3f& point = scan.scan.points_lidar[i];
    if (!(point.norm() <= max_range_m)) continue;
    const auto index = grid.index(T_map_lidar * point.cast<double>());
    on_border[i] = is_on_border(index, point);
    expected[{index.tile.x, index.tile.y}].push_back(i);
  }

  ScanSorter sorter(grid, max_range_m);
  std::size_t points = 0;
  for (const auto& batch : sorter.sort(scan, T_map_lidar, {})) {
    const auto& indices = expected[{batch.tile.x, batch.tile.y}];
    ASSERT_EQ(batch.points.size(), indices.size());
    for (std::size_t k = 0; k < indices.size(); ++k) {
      const TilePoint& placed = batch.points[k];
      const std::size_t i = indices[k];
      EXPECT_EQ(placed.label, scan.labels.classes[i]);
      EXPECT_EQ(placed.confidence, scan.labels.confidence[i]);
      EXPECT_EQ(placed.motion, scan.motion[i]);
      if (on_border[i]) continue;
      const auto index = grid.index(T_map_lidar * scan.scan.points_lidar[i].cast<double>());
      EXPECT_EQ(placed.voxel_key, voxel_key(index.voxel));
      for (std::size_t axis = 0; axis < 3; ++axis)
        EXPECT_EQ(placed.offset[axis],
                  static_cast<int>(index.offset[static_cast<Eigen::Index>(axis)] * 256.0));
    }
    points += indices.size();
  }
  EXPECT_GT(points, 8'000U);
  EXPECT_LT(points, scan.scan.size());
}

TEST(ScanSorter, LeavesOutWhatIsTooHighForTheGrid) {
  LabelledScan scan = scattered_points(100, 2);
  ScanSorter sorter(grid, max_range_m);
  const Eigen::Isometry3d T_high(Eigen::Translation3d(0.0, 0.0, 0.2 * 32766.0 - 5.0));
  for (Eigen::Vector3f& point : scan.scan.points_lidar) point = {1.0F, 1.0F, 10.0F};
  EXPECT_TRUE(sorter.sort(scan, T_high, {}).empty());
  for (Eigen::Vector3f& point : scan.scan.points_lidar) point = {1.0F, 1.0F, -10.0F};
  EXPECT_EQ(sorter.sort(scan, T_high, {}).size(), 1U);
}

TEST(ScanSorter, LeavesOutWhatNoWholeNumberHolds) {
  LabelledScan scan = scattered_points(100, 2);
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float huge = std::numeric_limits<float>::max();
  constexpr float infinite = std::numeric_limits<float>::infinity();
  const std::vector<float> none{nan, huge, -huge, infinite, -infinite, 1e12F, -1e12F};
  for (std::size_t i = 0; i < scan.scan.size(); ++i) {
    scan.scan.points_lidar[i] = {1.0F, 2.0F, 0.5F};
    if (i > 0) scan.scan.points_lidar[i][static_cast<Eigen::Index>(i % 3)] = none[i % none.size()];
  }
  ScanSorter sorter(grid, max_range_m);
  const auto batches = sorter.sort(scan, Eigen::Isometry3d::Identity(), {});
  ASSERT_EQ(batches.size(), 1U);
  EXPECT_EQ(batches[0].points.size(), 1U);
}

TEST(ScanSorter, PlacesNothingByATransformThatIsNone) {
  const LabelledScan scan = scattered_points(100, 2);
  ScanSorter sorter(grid, max_range_m);
  for (const double scale : {std::numeric_limits<double>::quiet_NaN(), 1e12}) {
    Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
    T_map_lidar.linear() *= scale;
    EXPECT_TRUE(sorter.sort(scan, T_map_lidar, {}).empty());
  }
}

}  // namespace
}  // namespace stillmap
