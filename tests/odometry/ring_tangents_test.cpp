#include "core/odometry/ring_tangents.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>
#include <vector>

namespace stillmap {
namespace {

constexpr double quarter_turn = 0.5 * M_PI;

/// One level ring with a beam every 0.2 degrees: `range_m(azimuth)` of what it meets.
Scan level_ring(double from, double to, const std::function<double(double)>& range_m) {
  constexpr double step = 0.2 * M_PI / 180.0;
  Scan scan;
  for (double azimuth = from; azimuth < to; azimuth += step) {
    const double range = range_m(azimuth);
    scan.points_lidar.emplace_back(static_cast<float>(range * std::cos(azimuth)),
                                   static_cast<float>(range * std::sin(azimuth)), 0.5F);
    scan.ring.push_back(3);
  }
  return scan;
}

std::vector<Eigen::Vector3f> tangents_of(const Scan& scan) {
  std::vector<std::uint32_t> all(scan.size());
  std::iota(all.begin(), all.end(), 0U);
  return ring_tangents(scan, all);
}

/// The point nearest to a place.
std::size_t nearest(const Scan& scan, const Eigen::Vector3f& place) {
  std::size_t best = 0;
  for (std::size_t i = 0; i < scan.size(); ++i)
    if ((scan.points_lidar[i] - place).norm() < (scan.points_lidar[best] - place).norm()) best = i;
  return best;
}

TEST(RingTangents, RunAlongASmoothWallHoweverFarApartItsPointsAre) {
  // 4 m beside the lidar: points 0.15 m apart at 13 m, 2.5 m at 54 m.
  const Scan scan = level_ring(0.07, 0.6, [](double azimuth) { return 4.0 / std::sin(azimuth); });
  const auto tangents = tangents_of(scan);
  for (const float x : {7.0F, 13.0F, 30.0F, 45.0F}) {
    const Eigen::Vector3f tangent = tangents[nearest(scan, {x, 4.0F, 0.5F})];
    EXPECT_NEAR(std::abs(tangent.x()), 1.0F, 1e-3F) << x;
  }
  EXPECT_TRUE(tangents.front().isZero()) << "nothing is known beyond the end";
}

TEST(RingTangents, CornersPolesAndJumpsHaveNone) {
  const Scan corner = level_ring(-quarter_turn, quarter_turn, [](double azimuth) {
    return 8.0 / std::max(std::abs(std::cos(azimuth)), std::abs(std::sin(azimuth)));
  });
  EXPECT_TRUE(tangents_of(corner)[nearest(corner, {8.0F, 8.0F, 0.5F})].isZero());
  const Scan pole = level_ring(-0.5, 0.5, [](double azimuth) {
    return std::abs(azimuth) < 0.01 ? 10.0 : 20.0 / std::cos(azimuth);
  });
  const auto tangents = tangents_of(pole);
  EXPECT_TRUE(tangents[nearest(pole, {10.0F, 0.0F, 0.5F})].isZero());
  EXPECT_TRUE(tangents[nearest(pole, {20.0F, 0.22F, 0.5F})].isZero()) << "beside the pole";
  EXPECT_NEAR(std::abs(tangents[nearest(pole, {20.0F, 5.0F, 0.5F})].y()), 1.0F, 1e-3F);
}

TEST(RingTangents, AreOfTheChosenPointsAndOfOneRing) {
  Scan scan = level_ring(-0.3, 0.3, [](double azimuth) { return 20.0 / std::cos(azimuth); });
  const std::size_t middle = nearest(scan, {20.0F, 0.0F, 0.5F});
  const std::vector<std::uint32_t> chosen{static_cast<std::uint32_t>(middle)};
  const auto tangents = ring_tangents(scan, chosen);
  for (std::size_t i = 0; i < scan.size(); ++i) EXPECT_EQ(tangents[i].isZero(), i != middle);
  scan.ring[middle] = 4;
  EXPECT_TRUE(ring_tangents(scan, chosen)[middle].isZero()) << "alone on its ring";
  EXPECT_TRUE(ring_tangents(Scan{}, {}).empty());
}

}  // namespace
}  // namespace stillmap
