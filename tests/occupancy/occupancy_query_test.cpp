#include "core/occupancy/occupancy_query.hpp"

#include <gmock/gmock.h>
#include <octomap/OcTree.h>

#include <limits>

#include "core/occupancy/occupancy_map.hpp"
#include "tests/occupancy/random_scans.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

/// Free along x from 0.1 to about 9 m, a wall's voxel at 10.1 m; all else unknown.
class OccupancyQuery : public testing::Test {
 protected:
  OccupancyQuery() {
    map_.insert(one_point({10.0F, 0.0F, 0.0F}), Eigen::Isometry3d(Eigen::Translation3d(at_)));
  }
  const Eigen::Vector3d at_{0.1, 0.1, 0.1};
  OccupancyMap map_{OccupancyConfig{}};
};

TEST_F(OccupancyQuery, PointsAreFreeOccupiedOrUnknown) {
  EXPECT_EQ(map_.at_point({5.0, 0.1, 0.1}).occupancy, Occupancy::free);
  EXPECT_NEAR(map_.at_point({5.0, 0.1, 0.1}).probability, 0.4F, 1e-4F);
  EXPECT_EQ(map_.at_point({10.1, 0.1, 0.1}).occupancy, Occupancy::occupied);
  EXPECT_NEAR(map_.at_point({10.1, 0.1, 0.1}).probability, 0.7F, 1e-4F);
  EXPECT_EQ(map_.at_point({5.0, 1.0, 0.1}).occupancy, Occupancy::unknown);
  EXPECT_EQ(map_.at_point({5.0, 1.0, 0.1}).probability, 0.5F);
}

TEST_F(OccupancyQuery, BoxesCountVoxelsAndListTheOccupiedOnes) {
  // 10 voxels along x, 3 along y and z.
  const Eigen::AlignedBox3d end_map(Eigen::Vector3d(8.3, -0.1, -0.1),
                                    Eigen::Vector3d(10.1, 0.3, 0.3));
  const BoxOccupancy box = map_.in_box(end_map, 10);
  EXPECT_EQ(box.fault, "");
  EXPECT_EQ(box.occupied, 1U);
  EXPECT_GT(box.free, 0U);
  EXPECT_EQ(box.occupied + box.free + box.unknown, 90U);
  ASSERT_EQ(box.occupied_map.size(), 1U);
  EXPECT_LT((box.occupied_map[0] - Eigen::Vector3f(10.1F, 0.1F, 0.1F)).norm(), 1e-3F);
  EXPECT_TRUE(map_.in_box(end_map, 0).occupied_map.empty());
  EXPECT_EQ(map_.in_box(end_map, 0).occupied, 1U);
  EXPECT_EQ(map_.in_box({Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(2, 1, 1)}, 9).occupied, 0U);
}

TEST_F(OccupancyQuery, RaysEndAtWhatIsOccupiedOrUnknownOrAtTheirRange) {
  const RayOccupancy hit = map_.along_ray(
      {.origin_map = {8.0, 0.1, 0.1}, .direction_map = {3, 0, 0}, .ignore_unknown = true});
  EXPECT_EQ(hit.end, Occupancy::occupied);
  EXPECT_NEAR(hit.length_m, 2.0, 1e-9);
  EXPECT_LT((hit.end_map - Eigen::Vector3d(10.0, 0.1, 0.1)).norm(), 1e-9);

  const RayOccupancy free =
      map_.along_ray({.origin_map = at_, .direction_map = {1, 0, 0}, .max_range_m = 5.0});
  EXPECT_EQ(free.end, Occupancy::free);
  EXPECT_EQ(free.length_m, 5.0);

  const RayOccupancy unknown = map_.along_ray({.origin_map = at_, .direction_map = {0, 2, 0}});
  EXPECT_EQ(unknown.end, Occupancy::unknown);
  EXPECT_NEAR(unknown.length_m, 0.1, 1e-9);
}

TEST_F(OccupancyQuery, RaysLeaveTheMapAtItsEdge) {
  RayQuery ray{.origin_map = {6550.0, 0.1, 0.1}, .ignore_unknown = true};
  const RayOccupancy result = map_.along_ray(ray);
  EXPECT_EQ(result.end, Occupancy::free);
  EXPECT_NEAR(result.length_m, 3.6, 1e-6);
}

TEST_F(OccupancyQuery, RaysAgreeWithSmallSteps) {
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    const PlacedScan placed = random_scan(seed, 3000, 6.0);
    map_.insert(placed.scan, placed.T_map_lidar);
  }
  int hits = 0;
  for (const Eigen::Vector3f& p : random_scan(99, 200, 1.0).scan.scan.points_lidar) {
    const RayQuery ray{
        .origin_map = {0.51, 0.33, 0.27}, .direction_map = p.cast<double>(), .max_range_m = 8.0};
    const RayOccupancy result = map_.along_ray(ray);
    const Eigen::Vector3d direction = ray.direction_map.normalized();
    for (double at_m = 0.0; at_m < result.length_m - 1e-6; at_m += 0.01) {
      ASSERT_EQ(map_.at_point(ray.origin_map + at_m * direction).occupancy, Occupancy::free);
    }
    const Eigen::Vector3d behind_map = result.end_map + 1e-7 * direction;
    EXPECT_EQ(map_.at_point(behind_map).occupancy, result.end);
    if (result.end == Occupancy::occupied) ++hits;
  }
  EXPECT_GT(hits, 10);
}

TEST_F(OccupancyQuery, HostilePointsGetAReason) {
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(nan, 0, 0), Eigen::Vector3d(0, infinite, 0),
                                   Eigen::Vector3d(0, 0, 1e9), Eigen::Vector3d(-1e300, 0, 0)}) {
    EXPECT_THAT(map_.at_point(p).fault, HasSubstr("the occupancy map reaches from -6553.6"));
    EXPECT_EQ(map_.at_point(p).occupancy, Occupancy::unknown);
  }
}

TEST_F(OccupancyQuery, HostileBoxesGetAReason) {
  const auto fault = [&](const Eigen::Vector3d& min, const Eigen::Vector3d& max) {
    Eigen::AlignedBox3d box;
    box.min() = min;
    box.max() = max;
    return map_.in_box(box, 5).fault;
  };
  const Eigen::Vector3d one = Eigen::Vector3d::Ones();
  EXPECT_THAT(fault(-1e9 * one, 1e9 * one), HasSubstr("box's minimum is -1e+09"));
  EXPECT_THAT(fault(one, nan * one), HasSubstr("box's maximum is nan"));
  EXPECT_THAT(fault(-infinite * one, infinite * one), HasSubstr("inf"));
  EXPECT_THAT(fault(one, -one), HasSubstr("above its maximum"));
  EXPECT_THAT(fault(nan * one, nan * one), HasSubstr("nan"));
  // As large as the map: counted at once.
  EXPECT_EQ(fault(-6553.0 * one, 6553.0 * one), "");
}

TEST(OccupancyOfManyBoxes, EndsWhereItTakesTooLong) {
  octomap::OcTree octree(0.1);
  for (const float x : {0.05F, 5.05F, -7.05F}) octree.updateNode(x, 0.05F, 0.05F, true);
  const Eigen::AlignedBox3d all(Eigen::Vector3d::Constant(-100), Eigen::Vector3d::Constant(100));
  std::size_t nodes_left = octree.size();
  EXPECT_EQ(query_box(octree, all, 10, nodes_left).occupied, 3U);
  EXPECT_EQ(nodes_left, 0U);
  nodes_left = octree.size() - 1;
  const BoxOccupancy cut = query_box(octree, all, 10, nodes_left);
  EXPECT_THAT(cut.fault, HasSubstr("several requests"));
  EXPECT_EQ(cut.occupied + cut.occupied_map.size(), 0U);
  EXPECT_THAT(query_box(octree, all, 10, nodes_left).fault, HasSubstr("several requests"));
}

TEST_F(OccupancyQuery, HostileRaysGetAReason) {
  const auto fault = [&](const RayQuery& ray) { return map_.along_ray(ray).fault; };
  EXPECT_THAT(fault({.origin_map = {nan, 0, 0}}), HasSubstr("ray's origin"));
  EXPECT_THAT(fault({.origin_map = {0, 1e9, 0}}), HasSubstr("ray's origin"));
  EXPECT_THAT(fault({.direction_map = {0, 0, 0}}), HasSubstr("longer than 0"));
  EXPECT_THAT(fault({.direction_map = {nan, 0, 0}}), HasSubstr("finite"));
  EXPECT_THAT(fault({.direction_map = {infinite, 0, 0}}), HasSubstr("finite"));
  EXPECT_EQ(fault({.direction_map = {1e300, 0, 0}}), "");
  for (const double range_m : {0.0, -1.0, nan, 1e9, infinite}) {
    EXPECT_THAT(fault({.max_range_m = range_m}), HasSubstr("max_range_m"));
  }
}

TEST(OccupancyOfAnEmptyMap, IsUnknownEverywhere) {
  const OccupancyMap map(OccupancyConfig{});
  EXPECT_EQ(map.at_point({1, 2, 3}).occupancy, Occupancy::unknown);
  EXPECT_EQ(map.in_box({Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(0.5)}, 5).unknown, 27U);
  EXPECT_EQ(map.along_ray({}).end, Occupancy::unknown);
}

}  // namespace
}  // namespace stillmap::test
