#include "core/map/static_map.hpp"

#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <tuple>

#include "core/map/voxel_grid.hpp"
#include "tests/map/map_worlds.hpp"

namespace stillmap {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3f;
using enum SemanticClass;
using test::add_point;

LabelledScan point_scan(const Vector3f& p, SemanticClass label, int count = 1,
                        Motion motion = Motion::stationary) {
  LabelledScan scan;
  for (int i = 0; i < count; ++i) add_point(scan, p, label, motion);
  return scan;
}

std::size_t voxel_count(const MapSnapshot& view) {
  std::size_t count = 0;
  for (const auto& tile : view.tiles) count += tile->voxels.size();
  return count;
}

std::vector<std::uint64_t> hashes(const MapSnapshot& view) {
  std::vector<std::uint64_t> hashes;
  for (const auto& tile : view.tiles) hashes.push_back(tile->info.content_hash);
  return hashes;
}

TEST(StaticMap, AgreesWithAPlainMapOfVoxels) {
  struct Sum {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    std::uint32_t count = 0;
  };
  const StaticMapConfig config{.min_points = 2};
  StaticMap map(config);
  std::map<std::tuple<int, int, int>, Sum> expected;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> coordinate(-14.0F, 14.0F);
  const Isometry3d T_map_lidar =
      Eigen::Translation3d(-3.0, 19.0, 1.0) * Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ());
  LabelledScan scan;
  for (int i = 0; i < 60'000; ++i) {
    const Vector3f p(coordinate(random), coordinate(random), coordinate(random) / 14.0F);
    add_point(scan, p, road);
    const Eigen::Vector3d p_map = T_map_lidar * p.cast<double>();
    const Eigen::Vector3d voxel = (p_map / config.voxel_size_m).array().floor();
    Sum& sum = expected[{int(voxel.x()), int(voxel.y()), int(voxel.z())}];
    sum.mean = (sum.mean * sum.count + p_map) / (sum.count + 1);
    ++sum.count;
  }
  map.insert(scan, T_map_lidar);
  std::erase_if(expected, [](const auto& entry) { return entry.second.count < 2; });

  const auto view = map.view();
  ASSERT_EQ(voxel_count(*view), expected.size());
  for (const auto& tile : view->tiles) {
    EXPECT_TRUE(std::ranges::is_sorted(tile->voxels, {}, &Voxel::index));
    for (const Voxel& voxel : tile->voxels) {
      const auto found = expected.find({tile->info.id.x * 100 + voxel.index.x,
                                        tile->info.id.y * 100 + voxel.index.y, voxel.index.z});
      ASSERT_NE(found, expected.end());
      EXPECT_EQ(voxel.point_count, found->second.count);
      EXPECT_LT((voxel.mean_map.cast<double>() - found->second.mean).norm(), 7e-4)
          << "half a step of 1/256 voxel in each axis";
      EXPECT_TRUE(tile->info.bounds_map.contains(voxel.mean_map));
    }
  }
}

TEST(StaticMap, TileInfoAgreesWithItsVoxels) {
  StaticMap map = test::street_map(3, 200);
  const auto view = map.view();
  ASSERT_GT(view->tiles.size(), 4U);
  EXPECT_TRUE(std::ranges::is_sorted(view->tiles, {}, [](const auto& t) { return t->info.id; }));
  for (const auto& tile : view->tiles) {
    EXPECT_EQ(tile->info.voxel_count, tile->voxels.size());
    EXPECT_EQ(tile->info.content_hash, content_hash(tile->voxels.packed()));
  }
}

TEST(StaticMap, VoxelsAppearOnceTheyWereHitOftenEnough) {
  StaticMap map(StaticMapConfig{.min_points = 3});
  map.insert(point_scan({1, 1, 1}, pole, 2), Isometry3d::Identity());
  EXPECT_EQ(map.view()->version, 0U);
  map.insert(point_scan({1, 1, 1}, pole), Isometry3d::Identity());
  EXPECT_EQ(voxel_count(*map.view()), 1U);
}

TEST(StaticMap, MotionDecidesWhatEnters) {
  StaticMap map(StaticMapConfig{});
  map.insert(point_scan({1, 1, 1}, car, 9, Motion::semi_static), Isometry3d::Identity());
  map.insert(point_scan({5, 1, 1}, car, 9, Motion::highly_dynamic), Isometry3d::Identity());
  map.insert(point_scan({9, 1, 1}, building, 9), Isometry3d::Identity());
  const auto view = map.view();
  ASSERT_EQ(voxel_count(*view), 1U);
  EXPECT_EQ(view->tiles[0]->voxels[0].evidence.winner(), building);
}

TEST(StaticMap, SemiStaticPointsTurnAKnownVoxelAndItLeavesTheView) {
  StaticMap map(StaticMapConfig{});
  map.insert(point_scan({1, 1, 1}, building, 5), Isometry3d::Identity());
  ASSERT_EQ(map.view()->version, 1U);
  map.insert(point_scan({1, 1, 1}, car, 50, Motion::semi_static), Isometry3d::Identity());
  const auto gone = map.view();
  EXPECT_TRUE(gone->tiles.empty());
  EXPECT_EQ(gone->version, 2U);
  map.insert(point_scan({1, 1, 1}, building, 500), Isometry3d::Identity());
  const auto back = map.view();
  ASSERT_EQ(voxel_count(*back), 1U);
  EXPECT_EQ(back->tiles[0]->info.revision, 3U);
  EXPECT_EQ(back->tiles[0]->voxels[0].point_count, 505U) << "semi-static points are not counted";
}

TEST(StaticMap, PointsWithoutLabelsAreKeptAsUnlabeled) {
  LabelledScan scan = point_scan({1, 1, 1}, car, 5);
  scan.labels = {};
  StaticMap map(StaticMapConfig{});
  map.insert(scan, Isometry3d::Identity());
  const auto view = map.view();
  ASSERT_EQ(voxel_count(*view), 1U);
  EXPECT_EQ(view->tiles[0]->voxels[0].evidence.winner(), unlabeled);
}

TEST(StaticMap, AbsurdPointsAndPosesAreLeftOut) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinity = std::numeric_limits<float>::infinity();
  StaticMap map(StaticMapConfig{});
  LabelledScan scan;
  for (const float value : {nan, infinity, -infinity, 1e9F, 1e38F, 61.0F}) {
    for (int axis = 0; axis < 3; ++axis) {
      Vector3f p = Vector3f::Zero();
      p[axis] = value;
      add_point(scan, p, road);
      add_point(scan, p, road);
    }
  }
  map.insert(scan, Isometry3d::Identity());
  const LabelledScan good = point_scan({1, 1, 1}, road, 5);
  for (const double value : {double{nan}, double{infinity}, 1e5, 1e9, 1e300}) {
    for (int axis = 0; axis < 3; ++axis) {
      Isometry3d T_map_lidar = Isometry3d::Identity();
      T_map_lidar.translation()[axis] = value;
      map.insert(good, T_map_lidar);
    }
  }
  Isometry3d no_rotation = Isometry3d::Identity();
  no_rotation.linear() *= 1e6;
  map.insert(good, no_rotation);
  map.insert(LabelledScan{}, Isometry3d::Identity());
  EXPECT_EQ(map.view()->version, 0U);
  EXPECT_TRUE(map.view()->tiles.empty());
}

TEST(StaticMap, WorksOnEverySideOfTheOriginAndFarAway) {
  for (const double x : {-99'000.0, -20.0, -1e-9, 0.0, 99'000.0}) {
    for (const double z : {-6'000.0, 6'000.0}) {
      StaticMap map(StaticMapConfig{});
      const Eigen::Vector3d p_map(x, -x, z);
      const Isometry3d T_map_lidar(Eigen::Translation3d{p_map});
      map.insert(point_scan({0, 0, 0}, road, 2), T_map_lidar);
      const auto view = map.view();
      ASSERT_EQ(voxel_count(*view), 1U) << x << ' ' << z;
      EXPECT_LT((view->tiles[0]->voxels[0].mean_map.cast<double>() - p_map).norm(), 0.01);
      EXPECT_EQ(view->tiles[0]->info.id.x, std::floor(x / 20.0));
    }
  }
}

TEST(StaticMap, UnchangedTilesAreSharedAndChangedOnesGrow) {
  StaticMap map(StaticMapConfig{});
  map.insert(point_scan({1, 1, 1}, road, 2), Isometry3d::Identity());
  map.insert(point_scan({41, 1, 1}, road, 2), Isometry3d::Identity());
  const auto first = map.view();
  EXPECT_EQ(map.view(), first);
  map.insert(point_scan({42, 1, 1}, road, 2), Isometry3d::Identity());
  const auto second = map.view();
  EXPECT_EQ(second->version, first->version + 1);
  EXPECT_EQ(second->tiles[0], first->tiles[0]);
  EXPECT_NE(second->tiles[1], first->tiles[1]);
  EXPECT_EQ(second->tiles[1]->info.revision, second->version);
  EXPECT_EQ(first->tiles[1]->voxels.size(), 1U) << "a view never changes";
}

TEST(StaticMap, MoreOfTheSameIsNoChange) {
  StaticMap map(StaticMapConfig{});
  map.insert(point_scan({1.07F, 1.07F, 1.07F}, road, 20), Isometry3d::Identity());
  const auto before = map.view();
  map.insert(point_scan({1.07F, 1.07F, 1.07F}, road, 20), Isometry3d::Identity());
  EXPECT_EQ(map.view(), before);
}

TEST(StaticMap, ContentHashForgetsHistory) {
  const LabelledScan scan = test::street_scan(3, 100);
  LabelledScan reversed = scan;
  std::ranges::reverse(reversed.scan.points_lidar);
  std::ranges::reverse(reversed.labels.classes);
  StaticMap one(StaticMapConfig{});
  one.insert(scan, Isometry3d::Identity());
  one.insert(point_scan({3, 3, 1}, pole, 4), Isometry3d::Identity());
  StaticMap other(StaticMapConfig{});
  other.insert(point_scan({3, 3, 1}, pole, 2), Isometry3d::Identity());
  EXPECT_EQ(other.view()->tiles.size(), 1U);
  other.insert(point_scan({3, 3, 1}, pole, 2), Isometry3d::Identity());
  other.insert(reversed, Isometry3d::Identity());
  EXPECT_EQ(hashes(*one.view()), hashes(*other.view()));
}

TEST(StaticMap, DoesNotDependOnTheNumberOfThreads) {
  const auto hashes_with = [](std::size_t threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    StaticMap map = test::street_map(4, 300);
    return hashes(*map.view());
  };
  EXPECT_EQ(hashes_with(1), hashes_with(4));
}

TEST(StaticMap, RestoredMapGoesOnLikeTheOriginal) {
  StaticMap original = test::street_map(3, 200);
  MapSnapshot stored = *original.view();
  stored.map_id = 77;
  StaticMap restored(original.config());
  restored.resume(stored);
  EXPECT_EQ(restored.view()->version, stored.version);
  EXPECT_EQ(restored.view()->map_id, 77U);
  EXPECT_EQ(restored.view()->tiles, stored.tiles);

  const Isometry3d elsewhere(Eigen::Translation3d(3.0, 0.0, 1.73));
  restored.insert(test::street_scan(9, 200), elsewhere);
  original.insert(test::street_scan(9, 200), elsewhere);
  const auto next = restored.view();
  EXPECT_EQ(next->version, stored.version + 1);
  // Voxels seen once were not stored: a few are missing, none is made up.
  EXPECT_LE(voxel_count(*next), voxel_count(*original.view()));
  EXPECT_GT(voxel_count(*next), voxel_count(stored));
}

TEST(StaticMap, RestoreRefusesAnotherVoxelSize) {
  StaticMap original = test::street_map(1, 100);
  StaticMap other(StaticMapConfig{.voxel_size_m = 0.1});
  EXPECT_THAT(
      [&] { other.resume(*original.view()); },
      testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("voxel_size_m 0.2")));
}

TEST(StaticMap, ResetEmptiesAndRenames) {
  StaticMap map = test::street_map(1, 100);
  const auto before = map.view();
  map.reset(5);
  EXPECT_EQ(map.view()->version, 0U);
  EXPECT_EQ(map.view()->map_id, 5U);
  EXPECT_TRUE(map.view()->tiles.empty());
  EXPECT_FALSE(before->tiles.empty());
}

TEST(StaticMapConfig, NamesEveryFault) {
  EXPECT_EQ(StaticMapConfig{}.faults(), "");
  const StaticMapConfig bad{
      .voxel_size_m = -1.0, .tile_size_m = 3.14, .max_range_m = 0.0, .min_points = 0};
  EXPECT_THAT(bad.faults(), testing::AllOf(testing::HasSubstr("voxel_size_m = -1"),
                                           testing::HasSubstr("tile_size_m = 3.14"),
                                           testing::HasSubstr("max_range_m = 0"),
                                           testing::HasSubstr("min_points = 0")));
  EXPECT_THROW(StaticMap{bad}, std::invalid_argument);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE((StaticMapConfig{.voxel_size_m = nan}.faults()), "");
  EXPECT_NE((StaticMapConfig{.max_range_m = nan}.faults()), "");
  EXPECT_NE((StaticMapConfig{.tile_size_m = 20.05}.faults()), "");
  EXPECT_NE((StaticMapConfig{.voxel_size_m = 0.05}.faults()), "") << "400 columns are too many";
}

}  // namespace
}  // namespace stillmap
