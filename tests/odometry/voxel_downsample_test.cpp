#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <set>
#include <tuple>

#include "core/odometry/features.hpp"

namespace stillmap {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<Eigen::Vector3f> random_points(std::size_t count, float max_coordinate_m) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> coordinate(-max_coordinate_m, max_coordinate_m);
  std::vector<Eigen::Vector3f> points(count);
  for (Eigen::Vector3f& p : points)
    p = {coordinate(random), coordinate(random), coordinate(random)};
  return points;
}

/// The same with an ordered set of cubes.
std::vector<std::uint32_t> downsample_plainly(const std::vector<Eigen::Vector3f>& points,
                                              const std::vector<std::uint32_t>& chosen,
                                              double spacing_m) {
  std::set<std::tuple<int, int, int>> taken;
  std::vector<std::uint32_t> kept;
  const auto cube = [&](float v) { return static_cast<int>(std::floor(v / spacing_m)); };
  for (const std::uint32_t i : chosen)
    if (taken.emplace(cube(points[i].x()), cube(points[i].y()), cube(points[i].z())).second)
      kept.push_back(i);
  return kept;
}

TEST(VoxelDownsample, EqualsAnOrderedSetOfCubes) {
  const std::vector<Eigen::Vector3f> points = random_points(5000, 8.0F);
  std::vector<std::uint32_t> chosen(points.size());
  std::iota(chosen.begin(), chosen.end(), 0U);
  std::ranges::shuffle(chosen, std::mt19937(12));
  chosen.resize(4000);
  for (const double spacing_m : {0.1, 0.5, 1.0, 3.0, 100.0})
    EXPECT_EQ(voxel_downsample(points, chosen, spacing_m),
              downsample_plainly(points, chosen, spacing_m))
        << spacing_m;
}

TEST(VoxelDownsample, CubesDoNotMeetAtTheOrigin) {
  const std::vector<Eigen::Vector3f> points{{0.1F, 0.0F, 0.0F}, {-0.1F, 0.0F, 0.0F}};
  EXPECT_THAT(voxel_downsample(points, std::vector<std::uint32_t>{0, 1}, 1.0), ElementsAre(0, 1));
}

TEST(VoxelDownsample, FirstOfEqualPointsStays) {
  const std::vector<Eigen::Vector3f> points(50, Eigen::Vector3f(3.0F, -2.0F, 1.0F));
  EXPECT_THAT(voxel_downsample(points, std::vector<std::uint32_t>{30, 2, 49}, 0.2),
              ElementsAre(30));
}

TEST(VoxelDownsample, NothingOfNothing) {
  EXPECT_THAT(voxel_downsample({}, {}, 0.5), IsEmpty());
  EXPECT_THAT(voxel_downsample(random_points(10, 1.0F), {}, 0.5), IsEmpty());
}

}  // namespace
}  // namespace stillmap
