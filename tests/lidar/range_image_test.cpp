#include "core/lidar/range_image.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <random>

namespace stillmap {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double radians = pi / 180.0;
const ProjectionModel semantic_kitti{
    .rows = 64, .columns = 2048, .fov_up = 3.0 * radians, .fov_down = -25.0 * radians};

std::vector<Eigen::Vector3f> random_points(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> azimuth(-pi, pi), elevation(-35.0, 10.0),
      range_m(0.5, 80.0);
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < count; ++i) {
    const double a = azimuth(random), e = elevation(random) * radians, r = range_m(random);
    points.push_back(Eigen::Vector3d(r * std::cos(e) * std::cos(a), r * std::cos(e) * std::sin(a),
                                     r * std::sin(e))
                         .cast<float>());
  }
  return points;
}

struct Coordinates {
  double u, v;
};

/// Equation 1 as RangeNet++ means it, in the plainest form.
Coordinates plain_projection(const Eigen::Vector3f& point, const ProjectionModel& model) {
  const Eigen::Vector3d p = point.cast<double>();
  const double yaw = -std::atan2(p.y(), p.x());
  const double pitch = std::asin(p.z() / p.norm());
  const double fov = std::abs(model.fov_up) + std::abs(model.fov_down);
  return {0.5 * (yaw / pi + 1.0) * model.columns,
          (1.0 - (pitch + std::abs(model.fov_down)) / fov) * model.rows};
}

int floored_and_clamped(double coordinate, int size) {
  return std::clamp(static_cast<int>(std::floor(coordinate)), 0, size - 1);
}

bool on_border(double coordinate) { return std::abs(coordinate - std::round(coordinate)) < 1e-3; }

TEST(RangeImage, PutsPointsWhereThePlainFormulaDoes) {
  const auto points = random_points(50'000, 11);
  for (const ProjectionModel& model :
       {semantic_kitti, projection_model(vlp_16()), projection_model(hdl_64e())}) {
    const RangeImage image(points, model);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Coordinates expected = plain_projection(points[i], model);
      if (on_border(expected.u) || on_border(expected.v)) continue;
      const std::size_t pixel = image.pixel(floored_and_clamped(expected.v, model.rows),
                                            floored_and_clamped(expected.u, model.columns));
      ASSERT_EQ(image.pixel_of_point()[i], static_cast<std::int32_t>(pixel))
          << points[i].transpose();
    }
  }
}

TEST(RangeImage, KeepsTheNearestPointOfAPixelAndTheFirstOfEquallyNearOnes) {
  // A small image, so that pixels are crowded.
  const ProjectionModel model{.rows = 4, .columns = 32, .fov_up = 0.1, .fov_down = -0.5};
  auto points = random_points(5000, 12);
  points.insert(points.end(), points.begin(), points.begin() + 500);  // equal ranges
  const RangeImage image(points, model);

  const auto range_m = [&](std::int32_t i) {
    return image.range_of_point_m()[static_cast<std::size_t>(i)];
  };
  std::map<std::int32_t, std::vector<std::int32_t>> expected;
  for (std::size_t i = 0; i < points.size(); ++i) {
    expected[image.pixel_of_point()[i]].push_back(static_cast<std::int32_t>(i));
  }
  ASSERT_FALSE(expected.contains(RangeImage::none));
  for (std::size_t pixel = 0; pixel < image.pixel_count(); ++pixel) {
    const auto& all = expected[static_cast<std::int32_t>(pixel)];
    EXPECT_EQ(image.nearest()[pixel],
              all.empty() ? RangeImage::none : *std::ranges::min_element(all, {}, range_m));
  }
}

TEST(RangeImage, RangeIsTheNearestPointsDistance) {
  const auto points = random_points(3000, 13);
  const RangeImage image(points, semantic_kitti);
  std::size_t filled = 0;
  for (std::size_t pixel = 0; pixel < image.pixel_count(); ++pixel) {
    const std::int32_t nearest = image.nearest()[pixel];
    if (nearest == RangeImage::none) {
      EXPECT_EQ(image.range_m()[pixel], -1.0F);
      continue;
    }
    ++filled;
    EXPECT_FLOAT_EQ(image.range_m()[pixel], points[static_cast<std::size_t>(nearest)].norm());
  }
  EXPECT_GT(filled, 1000U);
}

TEST(RangeImage, ForwardIsTheMiddleAndLeftIsTheLeftHalf) {
  const float level = 0.0F;
  const std::vector<Eigen::Vector3f> points{
      {10, -0.001F, level}, {0, 10, level}, {0, -10, level}, {-10, 0.001F, level}};
  const RangeImage image(points, semantic_kitti);
  const auto column = [&](std::size_t i) { return image.pixel_of_point()[i] % image.columns(); };
  EXPECT_EQ(column(0), 1024);
  EXPECT_EQ(column(1), 512);
  EXPECT_EQ(column(2), 1536);
  EXPECT_EQ(column(3), 0);
}

TEST(RangeImage, SqueezesPointsBeyondTheFieldOfViewIntoItsEdges) {
  const std::vector<Eigen::Vector3f> points{{1, 0, 5}, {0, 0, 7}, {1, 0, -5}, {0, 0, -7}};
  const RangeImage image(points, semantic_kitti);
  const auto row = [&](std::size_t i) { return image.pixel_of_point()[i] / image.columns(); };
  EXPECT_EQ(row(0), 0);
  EXPECT_EQ(row(1), 0);
  EXPECT_EQ(row(2), 63);
  EXPECT_EQ(row(3), 63);
}

TEST(RangeImage, GivesEachBeamOfAnEvenSensorItsOwnRow) {
  for (const SensorModel& sensor : {vlp_16(), hdl_32e()}) {
    std::vector<Eigen::Vector3f> points;
    for (int ring = 0; ring < sensor.rings; ++ring) {
      const double e = sensor.beam_elevation(ring);
      points.push_back(Eigen::Vector3d(9 * std::cos(e), 0.1, 9 * std::sin(e)).cast<float>());
    }
    const RangeImage image(points, projection_model(sensor));
    for (int ring = 0; ring < sensor.rings; ++ring) {
      EXPECT_EQ(image.pixel_of_point()[static_cast<std::size_t>(ring)] / image.columns(), ring);
    }
  }
}

TEST(RangeImage, GivesNoPixelToPointsThatHaveNoDirection) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float inf = std::numeric_limits<float>::infinity();
  const std::vector<Eigen::Vector3f> points{{0, 0, 0},   {nan, 1, 1},  {1, nan, 1}, {1, 1, nan},
                                            {inf, 0, 0}, {0, -inf, 1}, {1, 0, inf}, {1e30F, 0, 0}};
  const RangeImage image(points, semantic_kitti);
  EXPECT_THAT(image.pixel_of_point(), testing::Each(RangeImage::none));
  EXPECT_THAT(image.nearest(), testing::Each(RangeImage::none));
}

TEST(RangeImage, BearsNoPointsAndManyEqualPoints) {
  const RangeImage none({}, semantic_kitti);
  EXPECT_EQ(none.point_count(), 0U);
  EXPECT_THAT(none.range_m(), testing::Each(-1.0F));
  const std::vector<Eigen::Vector3f> equal(100'000, Eigen::Vector3f(3, 2, -1));
  const RangeImage crowded(equal, semantic_kitti);
  EXPECT_EQ(crowded.nearest()[static_cast<std::size_t>(crowded.pixel_of_point()[0])], 0);
}

/// Row 0 of an image of 16 columns, of which `columns` see a point at these ranges.
RangeImage row_of(const std::vector<int>& columns, const std::vector<double>& ranges_m) {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const double azimuth = pi * (1.0 - (columns[i] + 0.5) / 8.0);
    points.push_back(
        (ranges_m[i] * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 0.5)).cast<float>());
  }
  return {points, {.rows = 2, .columns = 16, .fov_up = 0.9, .fov_down = -0.9}};
}

TEST(RangeImage, TellsWhatShareOfItsColumnsALidarSkips) {
  EXPECT_EQ(row_of({}, {}).share_in_gaps(3), 0.0);
  EXPECT_EQ(row_of({5}, {4.0}).share_in_gaps(3), 0.0);
  const std::vector<double> alike(16, 4.0);
  EXPECT_EQ(row_of({0, 1, 2, 3, 8}, alike).share_in_gaps(3), 0.0) << "four empty ones are no gap";
  EXPECT_EQ(row_of({0, 2, 4, 6, 8, 10, 12, 14}, alike).share_in_gaps(3), 0.5);
  EXPECT_NEAR(row_of({1, 14}, alike).share_in_gaps(3), 2.0 / 3.0, 1e-9) << "across the border";
}

TEST(RangeImage, FillsGapsWithWhatTheNearerEndSees) {
  const RangeImage image = row_of({2, 6, 9, 15}, {5.0, 4.0, 7.0, 8.0});
  const RangeImage filled = image.with_gaps_filled(3);
  constexpr std::int32_t none = RangeImage::none;
  // Of equally near ends the one of less range; of four empty ones together and more none.
  const std::vector<std::int32_t> expected{3, 0, 0,    0,    1,    1,    1,    1,
                                           2, 2, none, none, none, none, none, 3};
  EXPECT_EQ(std::vector(filled.nearest().begin(), filled.nearest().begin() + 16), expected);
  for (std::size_t pixel = 0; pixel < 16; ++pixel) {
    const float range_m = expected[pixel] == none
                              ? -1.0F
                              : image.range_of_point_m()[static_cast<std::size_t>(expected[pixel])];
    EXPECT_EQ(filled.range_m()[pixel], range_m);
  }
  EXPECT_TRUE(std::ranges::equal(filled.pixel_of_point(), image.pixel_of_point()));
  EXPECT_TRUE(std::ranges::all_of(filled.nearest().subspan(16), [](auto p) { return p == none; }));
}

TEST(Unproject, GivesEachPointTheValueOfItsPixel) {
  auto points = random_points(2000, 14);
  points.emplace_back(0, 0, 0);
  const RangeImage image(points, semantic_kitti);
  std::vector<int> values(image.pixel_count());
  for (std::size_t pixel = 0; pixel < values.size(); ++pixel)
    values[pixel] = static_cast<int>(pixel);
  const auto of_points = unproject<int>(image, values, -7);
  ASSERT_EQ(of_points.size(), points.size());
  for (std::size_t i = 0; i + 1 < points.size(); ++i) {
    EXPECT_EQ(of_points[i], image.pixel_of_point()[i]);
  }
  EXPECT_EQ(of_points.back(), -7);
}

}  // namespace
}  // namespace stillmap
