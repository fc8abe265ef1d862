#include "core/lidar/range_image_view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

namespace stillmap {
namespace {

constexpr int rings = 32;
constexpr int columns = 360;
constexpr double step_deg = 360.0 / columns;

SensorModel one_degree_lidar() {
  SensorModel sensor;
  sensor.rings = rings;
  sensor.columns = columns;
  sensor.fov_up = 5.0 * std::numbers::pi / 180.0;
  sensor.fov_down = (5.0 - rings) * std::numbers::pi / 180.0;
  return sensor;
}

/// In a pixel's middle share, so that rounding moves no point into the next one.
Eigen::Vector3f point_in(int row, int column, double share, double range_m) {
  const double elevation = (5.0 - row - share) * std::numbers::pi / 180.0;
  const double azimuth = std::numbers::pi * (1.0 - (column + share) * step_deg / 180.0);
  return (range_m * Eigen::Vector3d(std::cos(elevation) * std::cos(azimuth),
                                    std::cos(elevation) * std::sin(azimuth), std::sin(elevation)))
      .cast<float>();
}

using Pixels = std::map<std::pair<int, int>, double>;

/// The nearest return of the next row that has one, or the next but one, in columns from `first` to
/// `last`; 1000 m without one.
double beside_m(const Pixels& pixels, int row, int column, int step, int reach) {
  double nearest_m = 1000.0;
  for (int c = column - reach; c <= column + reach; ++c) {
    for (const int r : {row + step, row + 2 * step}) {
      const auto pixel = pixels.find({r, (c + columns) % columns});
      if (pixel == pixels.end()) continue;
      nearest_m = std::min(nearest_m, pixel->second);
      break;
    }
  }
  return nearest_m;
}

/// Points, several in most pixels and none in some rows, the outermost rows included.
struct ScatteredPoints {
  Scan scan;
  std::vector<std::pair<int, int>> pixel_of;
  Pixels nearest_m;

  explicit ScatteredPoints(unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_int_distribution<int> row(0, rings - 1), column(0, columns - 1);
    std::uniform_real_distribution<double> share(0.1, 0.9), range_m(2.0, 60.0);
    // No multiple of what is projected at once.
    for (int i = 0; i < 40001; ++i) {
      const std::pair pixel(row(random), column(random));
      if (pixel.first % 5 == 2) continue;
      const double r_m = range_m(random);
      scan.points_lidar.push_back(point_in(pixel.first, pixel.second, share(random), r_m));
      pixel_of.push_back(pixel);
      const auto [nearest, is_new] = nearest_m.try_emplace(pixel, r_m);
      if (!is_new) nearest->second = std::min(nearest->second, r_m);
    }
  }
};

/// Whether rounding may put the point beyond the outermost one.
bool is_outermost(const std::pair<int, int>& pixel) {
  return pixel.first == 0 || pixel.first == rings - 1;
}

TEST(RangeImageView, HasTheNearestReturnOfEachPixel) {
  const ScatteredPoints points(1);
  const RangeImageView view(points.scan, {}, one_degree_lidar(), Eigen::Isometry3d::Identity());
  for (std::size_t i = 0; i < points.scan.size(); ++i) {
    const auto seen = view.observe(points.scan.points_lidar[i]);
    if (!seen && is_outermost(points.pixel_of[i])) continue;
    ASSERT_TRUE(seen) << i;
    EXPECT_EQ(std::pair(seen->at.row, seen->at.column), points.pixel_of[i]);
    EXPECT_NEAR(seen->range_m, points.nearest_m.at(points.pixel_of[i]), 1e-4);
    EXPECT_FALSE(seen->movable);
  }
}

TEST(RangeImageView, TellsMovableReturnsApart) {
  const ScatteredPoints points(2);
  std::vector<SemanticClass> labels(points.scan.size(), SemanticClass::building);
  for (std::size_t i = 0; i < labels.size(); i += 2) labels[i] = SemanticClass::car;
  const RangeImageView view(points.scan, labels, one_degree_lidar(), Eigen::Isometry3d::Identity());
  for (std::size_t i = 0; i < points.scan.size(); ++i) {
    const auto seen = view.observe(points.scan.points_lidar[i]);
    if (!seen && is_outermost(points.pixel_of[i])) continue;
    ASSERT_TRUE(seen) << i;
    if (std::abs(seen->range_m - seen->point_range_m) > 1e-4F) continue;
    EXPECT_EQ(seen->movable, i % 2 == 0) << i;
  }
}

TEST(RangeImageView, LeavesOutWhatIsAboveTheBeamsOrHasNoRange) {
  ScatteredPoints points(3);
  points.scan.points_lidar = {Eigen::Vector3f::Zero(), {1.0F, 0.0F, 5.0F}, {1.0F, 0.0F, -5.0F}};
  std::vector<std::uint8_t> is_thin;
  const RangeImageView view(points.scan, one_degree_lidar(), Eigen::Isometry3d::Identity(),
                            is_thin);
  for (const Eigen::Vector3f& point : points.scan.points_lidar) EXPECT_FALSE(view.observe(point));
  EXPECT_EQ(is_thin, std::vector<std::uint8_t>(3, 0));
}

/// To the zenith all columns are alike; what is no point has none.
TEST(RangeImageView, HasPixelsForThePointsRightAboveAndBelowAndNoneForNaN) {
  SensorModel dome = one_degree_lidar();
  dome.fov_up = 0.5 * std::numbers::pi;
  dome.fov_down = -dome.fov_up;
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  ScatteredPoints points(3);
  points.scan.points_lidar = {{0.0F, 0.0F, 5.0F},
                              {nan, nan, nan},
                              {nan, 1.0F, 1.0F},
                              {3.0F, 0.0F, nan},
                              {0.0F, 0.0F, -1.0F}};
  std::vector<std::uint8_t> is_thin;
  const RangeImageView view(points.scan, dome, Eigen::Isometry3d::Identity(), is_thin);
  const auto above = view.observe(points.scan.points_lidar[0]);
  ASSERT_TRUE(above);
  EXPECT_EQ(above->range_m, 5.0F);
  const auto below = view.observe(points.scan.points_lidar[4]);
  ASSERT_TRUE(below);
  EXPECT_EQ(below->range_m, 1.0F);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_FALSE(view.observe(points.scan.points_lidar[i]));
  EXPECT_EQ(is_thin, std::vector<std::uint8_t>(5, 0));
}

TEST(RangeImageView, FindsWhatIsThinAsALookAtEveryPixelDoes) {
  int thin = 0;
  for (const unsigned seed : {4U, 5U, 6U}) {
    const ScatteredPoints points(seed);
    std::vector<std::uint8_t> is_thin;
    const RangeImageView view(points.scan, one_degree_lidar(), Eigen::Isometry3d::Identity(),
                              is_thin);
    for (std::size_t i = 0; i < points.scan.size(); ++i) {
      const auto [row, column] = points.pixel_of[i];
      const double range_m = points.nearest_m.at(points.pixel_of[i]);
      const double point_m = points.scan.points_lidar[i].norm();
      // Where the beam below comes down by enough is not looked at: all of these do.
      const double above_m = beside_m(points.nearest_m, row, column, -1, 1);
      const double below_m = beside_m(points.nearest_m, row, column, 1, 1);
      if (row < 12 || std::abs(above_m - range_m - 0.5) < 1e-3 ||
          std::abs(below_m - range_m - 0.5) < 1e-3 || std::abs(point_m - range_m - 0.3) < 1e-3)
        continue;
      if (below_m - range_m < 3.0 && below_m - range_m > 0.5) continue;
      const bool is_alone = above_m > range_m + 0.5 && below_m > range_m + 0.5 && below_m < 1000.0;
      const bool expected = row + 1 < rings && is_alone && point_m <= range_m + 0.3;
      EXPECT_EQ(is_thin[i] != 0, expected) << row << ", " << column;
      thin += expected ? 1 : 0;
    }
  }
  EXPECT_GT(thin, 200);
}

/// Of a lidar that fires in every so many columns, and sees a wall all round it.
RangeImageView view_of_few_shots(int columns_a_shot, SemanticClass label) {
  Scan scan;
  for (int row = 0; row < rings; ++row)
    for (int column = 0; column < columns; column += columns_a_shot)
      scan.points_lidar.push_back(point_in(row, column, 0.3, 10.0));
  const std::vector<SemanticClass> labels(scan.size(), label);
  return {scan, labels, one_degree_lidar(), Eigen::Isometry3d::Identity()};
}

TEST(RangeImageView, HasNoHolesBetweenTheShotsOfALidarThatFiresSeldom) {
  for (const int columns_a_shot : {1, 2, 3, 5}) {
    const RangeImageView view = view_of_few_shots(columns_a_shot, SemanticClass::building);
    for (int column = 0; column < columns; ++column) {
      const auto seen = view.observe(point_in(rings / 2, column, 0.5, 12.0));
      ASSERT_TRUE(seen) << columns_a_shot << " columns a shot, column " << column;
      EXPECT_NEAR(seen->range_m, 10.0F, 1e-4F);
      EXPECT_TRUE(view.sees_past(*seen, 9.0F));
      EXPECT_FALSE(view.sees_past(*seen, 11.0F));
    }
  }
}

TEST(RangeImageView, SaysWhetherABeamPassesBesideAPointBetweenShotsOfALidarThatFiresSeldom) {
  const RangeImageView dense = view_of_few_shots(1, SemanticClass::building);
  const RangeImageView sparse = view_of_few_shots(5, SemanticClass::building);
  int passed = 0;
  for (int column = 0; column < columns; ++column) {
    const Eigen::Vector3f point = point_in(rings / 2, column, 0.5, 5.0);
    EXPECT_TRUE(dense.has_beam_beside(*dense.observe(point))) << column;
    const bool is_near = sparse.has_beam_beside(*sparse.observe(point));
    passed += is_near ? 1 : 0;
    // Shots are in columns 0, 5, 10, ..
    if (is_near) {
      EXPECT_TRUE(column % 5 <= 1 || column % 5 == 4) << column;
    }
  }
  EXPECT_GT(passed, columns / 5);
}

/// Along x, 4 m to the left: its range changes by 6 m from one shot to the next, 20 m ahead.
TEST(RangeImageView, KnowsAWallThatItSeesAtAGrazingAngle) {
  Scan scan;
  constexpr double wall_y_m = 4.0;
  for (int row = 0; row < rings; ++row)
    for (int column = 90; column < 180; ++column) {
      const Eigen::Vector3f ray = point_in(row, column, 0.5, 1.0);
      scan.points_lidar.emplace_back(static_cast<float>(wall_y_m) / ray.y() * ray);
    }
  const std::vector<SemanticClass> labels(scan.size(), SemanticClass::building);
  const RangeImageView view(scan, labels, one_degree_lidar(), Eigen::Isometry3d::Identity());
  for (double x_m = 2.0; x_m < 12.0; x_m += 0.01) {
    const auto on_wall = view.observe(Eigen::Vector3d(x_m, wall_y_m, 0.0).cast<float>());
    ASSERT_TRUE(on_wall);
    EXPECT_TRUE(view.lies_on_surface(*on_wall, 0.05F)) << x_m;
    const auto before_wall = view.observe(Eigen::Vector3d(x_m, wall_y_m - 1.0, 0.0).cast<float>());
    ASSERT_TRUE(before_wall);
    EXPECT_FALSE(view.lies_on_surface(*before_wall, 0.05F)) << x_m;
  }
}

/// What stands behind something that could move is no surface of its own.
TEST(RangeImageView, KnowsNoSurfaceBetweenTwoThings) {
  Scan scan;
  std::vector<SemanticClass> labels;
  for (int row = 0; row < rings; ++row)
    for (int column = 0; column < columns; ++column) {
      const bool is_car = column % 4 < 2;
      scan.points_lidar.push_back(point_in(row, column, 0.5, is_car ? 10.0 : 10.5));
      labels.push_back(is_car ? SemanticClass::car : SemanticClass::building);
    }
  const RangeImageView view(scan, labels, one_degree_lidar(), Eigen::Isometry3d::Identity());
  for (int column = 0; column < columns; ++column) {
    const auto between = view.observe(point_in(rings / 2, column, 0.5, 10.25));
    ASSERT_TRUE(between);
    EXPECT_FALSE(view.lies_on_surface(*between, 0.1F)) << column;
  }
}

/// Of many at once as of each by itself.
TEST(RangeImageView, WhatIsNotMeasuredBehindIsNotSeenPast) {
  const ScatteredPoints points(11);
  const Eigen::Isometry3d T_map_lidar =
      Eigen::Translation3d(20.0, -7.0, 1.5) *
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.1, 0.2, 1.0).normalized());
  const RangeImageView view(points.scan, {}, one_degree_lidar(), T_map_lidar);
  std::mt19937 random(12);
  std::normal_distribution<float> coordinate_m(0.0F, 15.0F);
  std::vector<Eigen::Vector3f> asked_map;
  for (int i = 0; i < 3001; ++i)
    asked_map.push_back(view.origin_map() + Eigen::Vector3f(coordinate_m(random),
                                                            coordinate_m(random),
                                                            0.2F * coordinate_m(random)));
  asked_map.push_back(view.origin_map());
  asked_map.push_back(Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN()));
  const RangeImageView::Behind behind{.distance_m = 0.5F, .share = 0.02F, .max_range_m = 20.0F};
  std::vector<std::uint8_t> is_measured(asked_map.size());
  view.mark_measured_behind(asked_map, behind, is_measured);
  int ruled_out = 0, seen_past = 0;
  for (std::size_t i = 0; i < asked_map.size(); ++i) {
    const auto seen = view.observe(asked_map[i]);
    const float range_m = seen ? seen->point_range_m : 0.0F;
    const float beyond_m = range_m + behind.distance_m + behind.share * range_m;
    const bool is_far = range_m > behind.max_range_m;
    EXPECT_EQ(is_measured[i] != 0, seen && !is_far && seen->range_m > beyond_m) << i;
    ruled_out += is_measured[i] == 0 ? 1 : 0;
    seen_past += seen && view.sees_past(*seen, beyond_m) && !is_far ? 1 : 0;
  }
  EXPECT_GT(ruled_out, 500);
  EXPECT_GT(seen_past, 10);
}

}  // namespace
}  // namespace stillmap
