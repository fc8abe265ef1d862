#include "core/segmentation/beam_origin.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace stillmap {
namespace {

constexpr double usual_height_m = 1.73;

/// Walls of a court of 24 m x 30 m on level ground, seen by 32 beams from `height_m` above it; in
/// the frame of a robot whose origin lies below the lidar on the ground.
std::vector<Eigen::Vector3f> court(double height_m) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise_m(0.0, 0.01);
  std::vector<Eigen::Vector3f> points;
  for (int beam = 0; beam < 32; ++beam) {
    const double slope = std::tan((10.0 - 4.0 / 3.0 * beam) * std::numbers::pi / 180.0);
    for (int column = 0; column < 900; ++column) {
      const double azimuth = column * 2.0 * std::numbers::pi / 900.0;
      const double x = std::cos(azimuth), y = std::sin(azimuth);
      double distance_m = std::min(12.0 / std::abs(x), 15.0 / std::abs(y));
      if (slope < 0.0) distance_m = std::min(distance_m, -height_m / slope);
      distance_m += noise_m(random);
      points.push_back(
          Eigen::Vector3d(distance_m * x, distance_m * y, height_m + distance_m * slope)
              .cast<float>());
    }
  }
  return points;
}

std::vector<Eigen::Vector3f> lowered(std::vector<Eigen::Vector3f> points, double by_m) {
  for (Eigen::Vector3f& p : points) p.z() -= static_cast<float>(by_m);
  return points;
}

TEST(BeamOrigin, IsFoundWhereAScanIsInTheFrameOfTheRobot) {
  for (const double height_m : {0.6, 1.2, 2.3}) {
    const auto found = lidar_height_over_origin(court(height_m), usual_height_m);
    ASSERT_TRUE(found) << height_m;
    EXPECT_NEAR(*found, height_m, 0.051);
  }
}

TEST(BeamOrigin, IsThatOfTheFrameOfTheLidar) {
  for (const double height_m : {0.2, 0.6, 1.2, 2.3})
    EXPECT_FALSE(lidar_height_over_origin(lowered(court(height_m), height_m), usual_height_m))
        << height_m;
}

TEST(BeamOrigin, IsTakenToBeAsHighAsUsualWhereBeamsHaveNone) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> part(0.0F, 1.0F);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 20'000; ++i) {
    points.emplace_back(24.0F * part(random) - 12.0F, 30.0F * part(random) - 15.0F, 0.0F);
    points.emplace_back(12.0F, 30.0F * part(random) - 15.0F, 5.0F * part(random));
  }
  EXPECT_EQ(lidar_height_over_origin(points, usual_height_m), usual_height_m);
  EXPECT_FALSE(lidar_height_over_origin(lowered(points, 1.0), usual_height_m));
  EXPECT_FALSE(lidar_height_over_origin({}, usual_height_m));
}

}  // namespace
}  // namespace stillmap
