#include "core/segmentation/surface_slope.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/lidar/scan.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using Eigen::Vector3f;

constexpr double degree = std::numbers::pi / 180.0;
constexpr ProjectionModel model{
    .rows = 16, .columns = 90, .fov_up = 12 * degree, .fov_down = -20 * degree};

/// The point that each pixel's beam hits, if `range_m(direction)` is finite.
template <class Range>
std::vector<Vector3f> seen_by_all_beams(const Range& range_m) {
  std::vector<Vector3f> points;
  for (int row = 0; row < model.rows; ++row) {
    for (int column = 0; column < model.columns; ++column) {
      const double up = model.fov_up - (row + 0.5) / model.rows * (model.fov_up - model.fov_down);
      const double azimuth = std::numbers::pi * (1.0 - 2.0 * (column + 0.5) / model.columns);
      const Eigen::Vector3d way(std::cos(up) * std::cos(azimuth), std::cos(up) * std::sin(azimuth),
                                std::sin(up));
      const double far = range_m(way);
      if (std::isfinite(far)) points.push_back((far * way).cast<float>());
    }
  }
  return points;
}

double on_ground(const Eigen::Vector3d& way, double rise = 0.0) {
  constexpr double height_m = 1.8;
  const double down = rise * way.head<2>().norm() - way.z();
  return down > 0.02 ? height_m / down : std::numeric_limits<double>::infinity();
}

/// The slopes of all pixels with a point, which see others in their column.
std::vector<float> slopes(const std::vector<Vector3f>& points) {
  const RangeImage image(points, model);
  const std::vector<float> all = surface_slope_rad(image, points);
  std::vector<float> seen;
  for (std::size_t pixel = 0; pixel < all.size(); ++pixel)
    if (image.nearest()[pixel] != RangeImage::none) seen.push_back(all[pixel]);
  return seen;
}

TEST(SurfaceSlope, IsZeroOnLevelGround) {
  const auto points = seen_by_all_beams([](const auto& way) { return on_ground(way); });
  ASSERT_GT(points.size(), 500U);
  for (const float slope_rad : slopes(points)) EXPECT_NEAR(slope_rad, 0.0F, 1e-4F);
}

TEST(SurfaceSlope, IsThatOfARisingHillside) {
  const double rise = std::tan(15 * degree);
  const auto points = seen_by_all_beams([&](const auto& way) { return on_ground(way, rise); });
  ASSERT_GT(points.size(), 500U);
  for (const float slope_rad : slopes(points)) EXPECT_NEAR(slope_rad, 15 * degree, 1e-3);
}

TEST(SurfaceSlope, IsARightAngleOnAWall) {
  const auto points =
      seen_by_all_beams([](const auto& way) { return 9.0 / way.template head<2>().norm(); });
  ASSERT_EQ(points.size(), 16U * 90U);
  for (const float slope_rad : slopes(points)) EXPECT_NEAR(slope_rad, 90 * degree, 1e-3);
}

TEST(SurfaceSlope, IsMoreUnderAnOverhang) {
  // A cone that opens upwards around the lidar's axis would recede; this one leans inwards.
  const auto points = seen_by_all_beams(
      [](const auto& way) { return 9.0 / (way.template head<2>().norm() + 0.5 * way.z()); });
  for (const float slope_rad : slopes(points)) EXPECT_NEAR(slope_rad, std::atan2(1.0, -0.5), 1e-3);
}

TEST(SurfaceSlope, LooksAcrossTwoEmptyRowsButNoFurther) {
  std::vector<Vector3f> points;
  const auto all = seen_by_all_beams([](const auto&) { return 9.0; });
  for (const std::size_t row : {2U, 5U, 9U, 15U}) points.push_back(all[row * 90U]);
  const RangeImage image(points, model);
  const std::vector<float> slope_rad = surface_slope_rad(image, points);
  EXPECT_GT(std::abs(slope_rad[2U * 90U]), 0.1F);
  EXPECT_EQ(slope_rad[2U * 90U], slope_rad[5U * 90U]);
  EXPECT_EQ(slope_rad[9U * 90U], 0.0F);
  EXPECT_EQ(slope_rad[15U * 90U], 0.0F);
  EXPECT_EQ(slope_rad[3U * 90U], 0.0F);
}

/// The definition, a pixel at a time.
float by_hand(const RangeImage& image, const std::vector<Vector3f>& points, int row, int column) {
  const auto seen = [&](int r) {
    return r >= 0 && r < image.rows() &&
           image.nearest()[image.pixel(r, column)] != RangeImage::none;
  };
  if (!seen(row)) return 0.0F;
  const auto neighbour = [&](int step) {
    int r = row;
    for (int away = 3; away > 0; --away)
      if (seen(row + step * away)) r = row + step * away;
    return points[static_cast<std::size_t>(image.nearest()[image.pixel(r, column)])];
  };
  const Vector3f above = neighbour(-1), below = neighbour(1);
  return std::atan2(above.z() - below.z(), above.head<2>().norm() - below.head<2>().norm());
}

TEST(SurfaceSlope, IsThatOfItsDefinitionInEveryPixel) {
  const Scan scan = test::random_scan(700, 9);
  const RangeImage image(scan.points_lidar, model);
  const std::vector<float> slope_rad = surface_slope_rad(image, scan.points_lidar);
  int sloping = 0;
  for (int row = 0; row < model.rows; ++row) {
    for (int column = 0; column < model.columns; ++column) {
      const float expected = by_hand(image, scan.points_lidar, row, column);
      EXPECT_NEAR(slope_rad[image.pixel(row, column)], expected, 4e-4F) << row << ' ' << column;
      sloping += expected != 0.0F ? 1 : 0;
    }
  }
  EXPECT_GT(sloping, 200);
}

TEST(SurfaceSlope, IsFiniteForAnyScan) {
  Scan scan = test::random_scan(3000, 5);
  scan.points_lidar[7].x() = std::numeric_limits<float>::quiet_NaN();
  scan.points_lidar[8].setZero();
  scan.points_lidar[9] = {1e30F, 1e30F, 1.0F};
  const RangeImage image(scan.points_lidar, model);
  for (const float slope_rad : surface_slope_rad(image, scan.points_lidar))
    EXPECT_TRUE(std::isfinite(slope_rad));
}

}  // namespace
}  // namespace stillmap
