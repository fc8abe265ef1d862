#include "core/odometry/feature_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <tuple>

namespace stillmap {
namespace {

/// A map that keeps every point, for comparison with a plain list.
LocalMapConfig roomy() {
  LocalMapConfig config;
  config.max_points_per_voxel = 32;
  config.min_spacing_m = 0.0;
  return config;
}

std::vector<LabelledPoint> random_points(std::size_t count, const Eigen::Vector3f& centre,
                                         const Eigen::Vector3f& half_size, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> share(-1.0F, 1.0F);
  std::vector<LabelledPoint> points(count);
  for (LabelledPoint& point : points) {
    const Eigen::Vector3f offset(share(random), share(random), share(random));
    point.position_map = centre + offset.cwiseProduct(half_size);
    point.label = random() % 3 == 0 ? SemanticClass::car : SemanticClass::building;
  }
  return points;
}

std::vector<float> nearest_plainly(const std::vector<LabelledPoint>& points,
                                   const Eigen::Vector3f& position, int n, float max_distance_m) {
  std::vector<float> squared;
  for (const LabelledPoint& point : points) {
    const float d = (point.position_map - position).squaredNorm();
    if (d <= max_distance_m * max_distance_m) squared.push_back(d);
  }
  std::ranges::sort(squared);
  squared.resize(std::min(squared.size(), static_cast<std::size_t>(n)));
  return squared;
}

/// Compares every answer with the plain search, round `centre`.
void expect_nearest_as_plain(const Eigen::Vector3f& centre, double voxel_size_m) {
  const Eigen::Vector3f half_size(5.0F, 4.0F, 2.0F);
  const auto points = random_points(1500, centre, half_size, 21);
  LocalMapConfig config = roomy();
  config.voxel_size_m = voxel_size_m;
  FeatureMap map(config);
  map.insert(points);
  ASSERT_EQ(map.size(), points.size());
  const auto queries = random_points(1600, centre, 1.2F * half_size, 22);
  for (std::size_t q = 0; q < queries.size(); ++q) {
    const int n = 1 + static_cast<int>(q % Neighbours::capacity);
    const float max_distance_m = static_cast<float>(voxel_size_m) * (q % 3 == 0 ? 0.4F : 1.0F);
    const Eigen::Vector3f& position = queries[q].position_map;
    const Neighbours found = map.nearest(position, n, max_distance_m);
    const auto expected = nearest_plainly(points, position, n, max_distance_m);
    ASSERT_EQ(static_cast<std::size_t>(found.count), expected.size()) << "n " << n;
    for (std::size_t k = 0; k < expected.size(); ++k) {
      EXPECT_FLOAT_EQ(found.squared_distance[k], expected[k]);
      EXPECT_FLOAT_EQ((found.points[k].position_map - position).squaredNorm(), expected[k]);
    }
  }
}

TEST(FeatureMapNearest, EqualsPlainSearchRoundTheOrigin) {
  expect_nearest_as_plain(Eigen::Vector3f::Zero(), 1.0);
}

TEST(FeatureMapNearest, EqualsPlainSearchFarFromTheOrigin) {
  expect_nearest_as_plain({-1500.3F, 2100.7F, 35.1F}, 1.0);
}

TEST(FeatureMapNearest, EqualsPlainSearchWithSmallVoxels) {
  expect_nearest_as_plain({3.0F, -7.0F, 0.0F}, 0.7);
}

TEST(FeatureMapNearest, BringsTheLabels) {
  FeatureMap map(roomy());
  const std::vector<LabelledPoint> points{{{0.0F, 0.0F, 0.0F}, SemanticClass::pole},
                                          {{0.3F, 0.0F, 0.0F}, SemanticClass::road}};
  map.insert(points);
  const Neighbours found = map.nearest({0.2F, 0.0F, 0.0F}, 5, 1.0F);
  ASSERT_EQ(found.count, 2);
  EXPECT_EQ(found.points[0].label, SemanticClass::road);
  EXPECT_EQ(found.points[1].label, SemanticClass::pole);
}

TEST(FeatureMapNearest, FindsNothingInAnEmptyMap) {
  EXPECT_EQ(FeatureMap(roomy()).nearest({1.0F, 2.0F, 3.0F}, 5, 1.0F).count, 0);
}

TEST(FeatureMapNearest, FindsNothingWhereThereIsNoPlace) {
  FeatureMap map(roomy());
  map.insert(random_points(100, Eigen::Vector3f::Zero(), Eigen::Vector3f::Ones(), 23));
  for (const float nowhere : {NAN, INFINITY, -INFINITY, 1e9F, -3e38F}) {
    EXPECT_EQ(map.nearest({nowhere, 0.0F, 0.0F}, 1, 0.5F).count, 0) << nowhere;
    EXPECT_EQ(map.nearest({0.0F, nowhere, nowhere}, 1, 0.5F).count, 0) << nowhere;
  }
}

TEST(FeatureMapInsert, KeepsSpacingAndCapacityOfEveryVoxel) {
  LocalMapConfig config;
  config.min_spacing_m = 0.25;
  config.max_points_per_voxel = 7;
  FeatureMap map(config);
  map.insert(random_points(20'000, Eigen::Vector3f::Zero(), {2.0F, 2.0F, 2.0F}, 31));
  // A full voxel's points are all within sqrt(3)/2 m of its centre, so ask eight places in it.
  std::map<std::tuple<int, int, int>, std::vector<Eigen::Vector3f>> voxels;
  std::map<std::tuple<float, float, float>, bool> seen;
  for (const LabelledPoint& query :
       random_points(20'000, Eigen::Vector3f::Zero(), {2.0F, 2.0F, 2.0F}, 32)) {
    const Neighbours found = map.nearest(query.position_map, 1, 1.0F);
    for (int k = 0; k < found.count; ++k) {
      const Eigen::Vector3f p = found.points[static_cast<std::size_t>(k)].position_map;
      if (!seen.emplace(std::tuple(p.x(), p.y(), p.z()), true).second) continue;
      const Eigen::Vector3i v = p.array().floor().cast<int>();
      voxels[{v.x(), v.y(), v.z()}].push_back(p);
    }
  }
  EXPECT_EQ(seen.size(), map.size()) << "some points were never the nearest";
  EXPECT_EQ(voxels.size(), 64U);
  for (const auto& [voxel, points] : voxels) {
    EXPECT_LE(points.size(), 7U);
    for (std::size_t a = 0; a < points.size(); ++a)
      for (std::size_t b = a + 1; b < points.size(); ++b)
        EXPECT_GE((points[a] - points[b]).norm(), 0.25F);
  }
}

TEST(FeatureMapInsert, SamePointsTwiceAddNothing) {
  const auto points = random_points(500, Eigen::Vector3f::Zero(), {9.0F, 9.0F, 9.0F}, 33);
  FeatureMap map{LocalMapConfig{}};
  map.insert(points);
  const std::size_t size = map.size();
  map.insert(points);
  EXPECT_EQ(map.size(), size);
}

TEST(FeatureMapForget, KeepsWhatIsNearAndForgetsWhatIsFar) {
  LocalMapConfig config = roomy();
  config.radius_m = 10.0;
  const auto points = random_points(8000, Eigen::Vector3f::Zero(), {25.0F, 25.0F, 1.0F}, 41);
  FeatureMap map(config);
  map.insert(points);
  const Eigen::Vector3f centre(3.0F, -4.0F, 0.0F);
  map.remove_far_from(centre);
  std::size_t left = 0;
  for (const LabelledPoint& point : points) {
    const bool is_there = map.nearest(point.position_map, 1, 0.0F).count == 1;
    left += is_there ? 1 : 0;
    // Whole voxels are forgotten; their diagonal is sqrt(3) m.
    const float distance = (point.position_map - centre).norm();
    EXPECT_TRUE(is_there || distance > 10.0F - 1.75F) << distance;
    EXPECT_TRUE(!is_there || distance < 10.0F + 1.75F) << distance;
  }
  EXPECT_EQ(map.size(), left);
}

TEST(FeatureMapForget, RoomOfForgottenVoxelsIsUsedAgain) {
  LocalMapConfig config = roomy();
  config.radius_m = 5.0;
  FeatureMap map(config);
  for (int k = 0; k < 50; ++k) {
    const Eigen::Vector3f centre(20.0F * static_cast<float>(k), 0.0F, 0.0F);
    const auto points = random_points(300, centre, {2.0F, 2.0F, 2.0F}, 42U + unsigned(k));
    map.insert(points);
    map.remove_far_from(centre);
    ASSERT_EQ(map.size(), points.size());
    const Neighbours found = map.nearest(points[7].position_map, 1, 1.0F);
    ASSERT_EQ(found.count, 1);
    EXPECT_EQ(found.points[0].position_map, points[7].position_map);
    EXPECT_EQ(found.points[0].label, points[7].label);
  }
}

TEST(FeatureMapRemove, TakesOutTheMovablePointsOfAPlaceOnly) {
  const auto points = random_points(3000, Eigen::Vector3f::Zero(), {5.0F, 5.0F, 2.0F}, 51);
  FeatureMap map(roomy());
  map.insert(points);
  map.remove_movable_if([](const Eigen::Vector3f& p_map) { return p_map.x() > 1.0F; });
  std::size_t left = 0;
  for (const LabelledPoint& point : points) {
    const bool gone = is_movable(point.label) && point.position_map.x() > 1.0F;
    EXPECT_EQ(map.nearest(point.position_map, 1, 0.0F).count, gone ? 0 : 1);
    left += gone ? 0 : 1;
  }
  EXPECT_EQ(map.size(), left);
  EXPECT_LT(left, points.size());
}

TEST(RemoveMovable, FindsThoseOfVoxelsThatWereEmptiedAndFilledAgain) {
  const auto none_stays = [](const Eigen::Vector3f&) { return true; };
  const auto all_stay = [](const Eigen::Vector3f&) { return false; };
  FeatureMap map(roomy());
  for (int round = 0; round < 3; ++round) {
    const auto points = random_points(500, Eigen::Vector3f::Zero(), {5.0F, 5.0F, 2.0F}, 71);
    const auto fixed = static_cast<std::size_t>(std::ranges::count_if(
        points, [](const LabelledPoint& point) { return !is_movable(point.label); }));
    map.insert(points);
    map.remove_movable_if(all_stay);
    EXPECT_EQ(map.size(), points.size());
    map.remove_movable_if(none_stays);
    EXPECT_EQ(map.size(), fixed);
    map.insert(points);
    // Far away all voxels go, and their blocks are used by others.
    map.remove_far_from({1000.0F * static_cast<float>(round + 1), 500.0F, 0.0F});
    EXPECT_EQ(map.size(), 0U);
  }
}

TEST(FeatureMapClear, LeavesNothing) {
  FeatureMap map(roomy());
  EXPECT_EQ(map.size(), 0U);
  map.insert(random_points(100, Eigen::Vector3f::Zero(), {5.0F, 5.0F, 2.0F}, 61));
  EXPECT_GT(map.size(), 0U);
  map.clear();
  EXPECT_EQ(map.size(), 0U);
  EXPECT_EQ(map.nearest({0.0F, 0.0F, 0.0F}, 16, 1.0F).count, 0);
}

}  // namespace
}  // namespace stillmap
