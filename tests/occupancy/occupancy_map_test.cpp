#include "core/occupancy/occupancy_map.hpp"

#include <gmock/gmock.h>

#include <limits>

#include "core/map/static_map.hpp"
#include "tests/map/map_worlds.hpp"
#include "tests/occupancy/dense_occupancy.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

OccupancyConfig small_config() {
  OccupancyConfig config;
  config.resolution_m = 0.25;
  config.max_range_m = 3.5;
  config.clearing_range_m = 2.5;
  config.clearing_interval = 2;
  config.clearing_margin_m = 0.2;
  return config;
}

Eigen::Isometry3d at(double x) { return Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, 0.0)); }

TEST(OccupancyMap, AgreesWithADenseReference) {
  OccupancyMap map(small_config());
  DenseOccupancy reference(small_config(), 24);
  for (std::uint32_t seed = 0; seed < 12; ++seed) {
    const PlacedScan placed = random_scan(seed, 60, 3.0);
    const ScanUpdateOptions use{.clear_free_space = seed % 5 != 4, .unknown_is_solid = true};
    map.insert(placed.scan, placed.T_map_lidar, use);
    reference.insert(placed, use);
  }
  std::uint64_t occupied = 0;
  for (const auto& [key, log_odds] : reference.log_odds()) {
    const PointOccupancy here = map.at_point(reference.centre_map(key));
    ASSERT_NE(here.occupancy, Occupancy::unknown);
    EXPECT_NEAR(here.probability, 1.0 / (1.0 + std::exp(-log_odds)), 1e-4);
    if (here.occupancy == Occupancy::occupied) ++occupied;
  }
  const Eigen::Vector3d corner = Eigen::Vector3d::Constant(5.9);
  const BoxOccupancy all = map.in_box({-corner, corner}, 0);
  EXPECT_GT(occupied, 100U);
  EXPECT_EQ(all.occupied, occupied);
  EXPECT_EQ(all.occupied + all.free, reference.log_odds().size());
}

TEST(OccupancyMap, UpdatesInPortionsEqualOneUpdate) {
  OccupancyMap map(small_config());
  OccupancyMap undisturbed(small_config());
  int pauses = 0;
  int portions = 0;
  for (std::uint32_t seed = 0; seed < 2; ++seed) {
    const PlacedScan placed = random_scan(seed, 300, 3.0);
    map.compute_update(placed.scan, placed.T_map_lidar, {}, [&] { ++pauses; });
    while (map.apply_update(7)) ++portions;
    undisturbed.insert(placed.scan, placed.T_map_lidar);
  }
  EXPECT_GE(pauses, 2 * 300 / 64);
  EXPECT_GT(portions, 10);
  EXPECT_EQ(map.encode(OctomapEncoding::full).bytes,
            undisturbed.encode(OctomapEncoding::full).bytes);
}

TEST(OccupancyMap, DynamicAndMovableObjectsAreNotOccupiedButTheirRaysClear) {
  for (const Motion motion : {Motion::semi_static, Motion::highly_dynamic}) {
    OccupancyMap map(OccupancyConfig{});
    map.insert(one_point({10.1F, 0.1F, 0.1F}, motion), at(0.1));
    EXPECT_EQ(map.at_point({10.2, 0.1, 0.1}).occupancy, Occupancy::unknown);
    EXPECT_EQ(map.at_point({5.0, 0.1, 0.1}).occupancy, Occupancy::free);
  }
}

TEST(OccupancyMap, UnlabelledPointsAreOccupiedUnlessTheyMayMove) {
  LabelledScan scan = one_point({5.1F, 0.1F, 0.1F});
  for (const bool is_solid : {true, false}) {
    OccupancyMap map(OccupancyConfig{});
    map.insert(scan, at(0.0), {.clear_free_space = true, .unknown_is_solid = is_solid});
    EXPECT_EQ(map.at_point({5.1, 0.1, 0.1}).occupancy,
              is_solid ? Occupancy::occupied : Occupancy::unknown);
  }
}

TEST(OccupancyMap, VoxelsSeenThroughBecomeFree) {
  OccupancyMap map(OccupancyConfig{});
  const Eigen::Vector3d place_map(5.1, 0.1, 0.1);
  map.insert(one_point({5.1F, 0.1F, 0.1F}), at(0.0));
  EXPECT_EQ(map.at_point(place_map).occupancy, Occupancy::occupied);
  for (int i = 0; i < 12; ++i) map.insert(one_point({20.0F, 0.4F, 0.4F}), at(0.0));
  EXPECT_EQ(map.at_point(place_map).occupancy, Occupancy::free);
}

TEST(OccupancyMap, ClearsEveryNthScanAndNeverWhenDisabled) {
  OccupancyConfig config;
  config.clearing_interval = 2;
  OccupancyMap map(config);
  const LabelledScan scan = one_point({10.0F, 0.1F, 0.1F});
  map.insert(scan, at(0.0), {.clear_free_space = false, .unknown_is_solid = true});
  map.insert(scan, at(0.0));
  EXPECT_EQ(map.at_point({5.0, 0.05, 0.05}).occupancy, Occupancy::unknown);
  map.insert(scan, at(0.0));
  EXPECT_EQ(map.at_point({5.0, 0.05, 0.05}).occupancy, Occupancy::free);
}

TEST(OccupancyMap, InvalidPointsAndPosesAreIgnored) {
  OccupancyMap map(OccupancyConfig{});
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinite = std::numeric_limits<float>::infinity();
  for (const auto& p :
       {Eigen::Vector3f(nan, 0, 0), Eigen::Vector3f(infinite, 0, 0), Eigen::Vector3f(0, 0, 0)}) {
    LabelledScan scan = one_point(p);
    if (p.isZero()) scan.motion[0] = Motion::highly_dynamic;
    map.insert(scan, at(0.0));
    map.insert(scan, at(std::numeric_limits<double>::quiet_NaN()));
    map.insert(scan, at(1e9));
  }
  EXPECT_EQ(map.size().nodes, 0U);
}

TEST(OccupancyMap, SaysHowManyVoxelsLieBeyondTheOctree) {
  StaticMap near((StaticMapConfig()));
  StaticMap both((StaticMapConfig()));
  const LabelledScan scan = street_scan(0, 60);
  for (int k = 0; k < 2; ++k) {
    near.insert(scan, Eigen::Isometry3d::Identity());
    both.insert(scan, Eigen::Isometry3d::Identity());
    both.insert(scan, Eigen::Isometry3d(Eigen::Translation3d(7000.0, 0.0, 0.0)));
  }
  OccupancyMap octree((OccupancyConfig()));
  EXPECT_NEAR(octree.reach_m(), 6553.4, 1e-6);
  EXPECT_EQ(octree.insert(*near.view()), 0U);
  const std::size_t beyond = both.view()->tiles.voxel_count() - near.view()->tiles.voxel_count();
  ASSERT_GT(beyond, 100U);
  EXPECT_EQ(octree.insert(*both.view()), beyond);
}

TEST(OccupancyMap, InsertsAStaticMapsVoxelsAtAnyResolution) {
  const MapSnapshot view = *street_map(10).view();
  for (const double resolution_m : {0.1, 0.2, 0.5}) {
    OccupancyConfig config;
    config.resolution_m = resolution_m;
    OccupancyMap map(config);
    map.insert(view);
    std::size_t voxels = 0;
    for (const auto& tile : view.tiles) {
      for (const Voxel& voxel : tile->voxels) {
        ++voxels;
        ASSERT_EQ(map.at_point(voxel.mean_map.cast<double>()).occupancy, Occupancy::occupied);
      }
    }
    const Eigen::Vector3d corner = Eigen::Vector3d::Constant(500.0);
    const BoxOccupancy all = map.in_box({-corner, corner}, 0);
    EXPECT_EQ(all.free, 0U);
    if (resolution_m > 0.2) {
      EXPECT_LT(all.occupied, voxels);
    } else {
      EXPECT_EQ(all.occupied, resolution_m == 0.2 ? voxels : 8 * voxels);
    }
  }
}

TEST(OccupancyConfig, NamesEveryFault) {
  OccupancyConfig config;
  EXPECT_EQ(config.faults(), "");
  config.resolution_m = 0.0;
  config.hit_probability = 0.3;
  config.clearing_range_m = std::numeric_limits<double>::quiet_NaN();
  const std::string said = message_of<std::invalid_argument>([&] { OccupancyMap map(config); });
  EXPECT_THAT(said, HasSubstr("occupancy.resolution_m is 0.0"));
  EXPECT_THAT(said, HasSubstr("occupancy.hit_probability"));
  EXPECT_THAT(said, HasSubstr("occupancy.clearing_range_m is nan"));
}

}  // namespace
}  // namespace stillmap::test
