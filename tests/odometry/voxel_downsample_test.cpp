#include "core/odometry/voxel_downsample.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <set>
#include <span>
#include <tuple>

namespace stillmap {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;
using ::testing::UnorderedElementsAre;

std::vector<Eigen::Vector3f> random_points(std::size_t count, float max_coordinate_m) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> coordinate(-max_coordinate_m, max_coordinate_m);
  std::vector<Eigen::Vector3f> points(count);
  for (Eigen::Vector3f& p : points)
    p = {coordinate(random), coordinate(random), coordinate(random)};
  return points;
}

using Cube = std::tuple<int, int, int>;

Cube cube_of(const Eigen::Vector3f& point, double spacing_m) {
  const auto cube = [&](float v) { return static_cast<int>(std::floor(v / spacing_m)); };
  return {cube(point.x()), cube(point.y()), cube(point.z())};
}

TEST(VoxelDownsample, KeepsOneOfTheChosenInEveryCube) {
  const std::vector<Eigen::Vector3f> points = random_points(50000, 8.0F);
  std::vector<std::uint32_t> all(points.size());
  std::iota(all.begin(), all.end(), 0U);
  std::ranges::shuffle(all, std::mt19937(12));
  for (const std::size_t count : {1U, 2U, 3U, 127U, 129U, 4000U, 40000U})
    for (const double spacing_m : {0.1, 0.5, 1.0, 3.0, 100.0}) {
      const std::span chosen(all.data(), count);
      std::set<Cube> cubes;
      for (const std::uint32_t i : chosen) cubes.insert(cube_of(points[i], spacing_m));
      std::set<Cube> kept;
      for (const std::uint32_t i : voxel_downsample(points, chosen, spacing_m)) {
        EXPECT_NE(std::ranges::find(chosen, i), chosen.end());
        EXPECT_TRUE(kept.insert(cube_of(points[i], spacing_m)).second) << "twice in a cube";
      }
      EXPECT_EQ(kept, cubes) << count << " points, " << spacing_m << " m";
    }
}

/// Mean of how far off the middle of their cubes the kept points of a wall lie along it, in cubes.
float lean_along(const std::vector<Eigen::Vector3f>& wall, float spacing_m) {
  std::vector<std::uint32_t> all(wall.size());
  std::iota(all.begin(), all.end(), 0U);
  const std::vector<std::uint32_t> kept = voxel_downsample(wall, all, spacing_m);
  float lean = 0.0F;
  for (const std::uint32_t i : kept) {
    const float cubes = wall[i].y() / spacing_m;
    lean += cubes - std::floor(cubes) - 0.5F;
  }
  return lean / static_cast<float>(kept.size());
}

/// The first one of each in its cube would lie half of the cube off its middle, or a quarter of it
/// where there are two.
TEST(VoxelDownsample, LeansToNoSideOfItsCubes) {
  for (const float step_m : {0.013F, 0.25F}) {
    std::vector<Eigen::Vector3f> wall;
    for (int ring = 0; ring < 30; ++ring)
      for (int k = 0; k < 4000; ++k)
        wall.emplace_back(10.0F, 0.125F + step_m * static_cast<float>(k),
                          0.51F * static_cast<float>(ring));
    EXPECT_LT(std::abs(lean_along(wall, 0.5F)), 0.02F) << "points " << step_m << " m apart";
  }
}

/// A wall at 45 degrees to the beams, whose ranges are noisy: of the points that are the first in
/// their cubes most are those that their noise carried there.
TEST(VoxelDownsample, TakesNoisyPointsFromNoSide) {
  constexpr float sigma_m = 0.03F;
  std::mt19937 random(13);
  std::normal_distribution<float> noise_m(0.0F, sigma_m);
  std::vector<Eigen::Vector3f> wall;
  std::vector<float> errors_m;
  for (int k = 0; k < 200000; ++k) {
    const float along_m = 0.01F * static_cast<float>(k);
    errors_m.push_back(noise_m(random));
    wall.emplace_back(along_m + errors_m.back(), along_m, 0.1F);
  }
  std::vector<std::uint32_t> all(wall.size());
  std::iota(all.begin(), all.end(), 0U);
  const auto mean_m = [&](const auto& some) {
    double sum_m = 0.0;
    for (const std::uint32_t i : some) sum_m += errors_m[i];
    return sum_m / static_cast<double>(some.size());
  };
  std::set<Cube> cubes;
  std::vector<std::uint32_t> first_ones;
  for (const std::uint32_t i : all)
    if (cubes.insert(cube_of(wall[i], 0.3)).second) first_ones.push_back(i);
  EXPECT_GT(mean_m(first_ones), 0.25 * sigma_m);
  EXPECT_LT(std::abs(mean_m(voxel_downsample(wall, all, 0.3))), 0.03 * sigma_m);
}

TEST(VoxelDownsample, CubesDoNotMeetAtTheOrigin) {
  const std::vector<Eigen::Vector3f> points{{0.1F, 0.0F, 0.0F}, {-0.1F, 0.0F, 0.0F}};
  EXPECT_THAT(voxel_downsample(points, std::vector<std::uint32_t>{0, 1}, 1.0),
              UnorderedElementsAre(0, 1));
}

TEST(VoxelDownsample, OneOfEqualPointsStays) {
  const std::vector<Eigen::Vector3f> points(50, Eigen::Vector3f(3.0F, -2.0F, 1.0F));
  EXPECT_THAT(voxel_downsample(points, std::vector<std::uint32_t>{30, 2, 49}, 0.2), SizeIs(1));
}

TEST(VoxelDownsample, NothingOfNothing) {
  EXPECT_THAT(voxel_downsample({}, {}, 0.5), IsEmpty());
  EXPECT_THAT(voxel_downsample(random_points(10, 1.0F), {}, 0.5), IsEmpty());
}

}  // namespace
}  // namespace stillmap
