#include "core/lidar/rings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

namespace stillmap {
namespace {

constexpr double pi = std::numbers::pi;

/// How the simulated file is laid out.
struct Layout {
  double start_azimuth = 0.0;
  double covered = 2.0 * pi;
  double sense = 1.0;
  double dropped = 0.0;
  double azimuth_noise = 0.0;
};

struct RingedScan {
  Scan scan;
  std::vector<std::uint16_t> truth;
};

/// A scan that is stored ring after ring. Beams leave up to 0.2 degrees beside their place, as a
/// real HDL-64E's seem to do in KITTI.
RingedScan ring_after_ring(const SensorModel& sensor, const Layout& layout, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> range_m(3.0, 60.0), part(0.0, 1.0);
  std::normal_distribution<double> noise(0.0, 1.0);
  RingedScan ringed;
  const int columns = 720;
  for (int ring = 0; ring < sensor.rings; ++ring) {
    for (int column = 0; column < columns; ++column) {
      if (part(random) < layout.dropped) continue;
      const double azimuth = layout.start_azimuth +
                             layout.sense * (column + 0.5) / columns * layout.covered +
                             layout.azimuth_noise * noise(random);
      const double elevation = sensor.beam_elevation(ring) + 0.003 * (part(random) - 0.5);
      const double r = range_m(random);
      ringed.scan.points_lidar.emplace_back(
          Eigen::Vector3d(r * std::cos(elevation) * std::cos(azimuth),
                          r * std::cos(elevation) * std::sin(azimuth), r * std::sin(elevation))
              .cast<float>());
      ringed.truth.push_back(static_cast<std::uint16_t>(ring));
    }
  }
  return ringed;
}

double share_wrong(const std::vector<std::uint16_t>& rings,
                   const std::vector<std::uint16_t>& truth) {
  if (rings.size() != truth.size()) return 1.0;
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < rings.size(); ++i) wrong += rings[i] != truth[i] ? 1 : 0;
  return static_cast<double>(wrong) / static_cast<double>(truth.size());
}

TEST(RingsFromOrder, FindsTheRingsOfAPerfectFile) {
  const RingedScan ringed = ring_after_ring(hdl_64e(), {});
  EXPECT_EQ(rings_from_order(ringed.scan, hdl_64e()), ringed.truth);
}

TEST(RingsFromOrder, BearsDroppedPointsAndJitter) {
  const RingedScan ringed =
      ring_after_ring(hdl_64e(), {.dropped = 0.3, .azimuth_noise = 0.5 * pi / 180.0});
  // Only points that jitter carries over the seam may land one ring off.
  EXPECT_LT(share_wrong(rings_from_order(ringed.scan, hdl_64e()), ringed.truth), 0.005);
}

TEST(RingsFromOrder, BearsPointsThatWereNotMeasured) {
  for (const float instead : {0.0F, std::numeric_limits<float>::quiet_NaN()}) {
    RingedScan ringed = ring_after_ring(hdl_64e(), {.start_azimuth = pi});
    const auto is_measured = [](std::size_t i) { return i % 10 >= 3; };
    for (std::size_t i = 0; i < ringed.scan.size(); ++i)
      if (!is_measured(i)) ringed.scan.points_lidar[i].setConstant(instead);
    const std::vector<std::uint16_t> rings = rings_from_order(ringed.scan, hdl_64e());
    ASSERT_EQ(rings.size(), ringed.truth.size());
    for (std::size_t i = 0; i < rings.size(); ++i) {
      if (!is_measured(i)) continue;
      ASSERT_EQ(rings[i], ringed.truth[i]) << i;
    }
  }
}

TEST(RingsFromOrder, KnowsEitherSenseAndEitherSeam) {
  for (const double sense : {1.0, -1.0}) {
    for (const double start : {0.0, pi}) {
      const RingedScan ringed =
          ring_after_ring(hdl_64e(), {.start_azimuth = start, .sense = sense, .dropped = 0.1});
      EXPECT_EQ(rings_from_order(ringed.scan, hdl_64e()), ringed.truth)
          << "sense " << sense << ", start " << start;
    }
  }
}

TEST(RingsFromOrder, KnowsAScanOfTheFrontOnly) {
  const RingedScan ringed = ring_after_ring(
      hdl_64e(), {.start_azimuth = -0.48 * pi, .covered = 0.96 * pi, .dropped = 0.1});
  EXPECT_LT(share_wrong(rings_from_order(ringed.scan, hdl_64e()), ringed.truth), 0.001);
}

TEST(RingsFromOrder, KnowsTheSeamOfACompensatedScan) {
  // Compensated for 1.5 m straight ahead in a sweep that begins and ends at the rear: a ring comes
  // together there with another slope, as if the next one began.
  for (const double start : {0.0, pi}) {
    RingedScan ringed = ring_after_ring(hdl_64e(), {.start_azimuth = start, .dropped = 0.1}, 5);
    for (Eigen::Vector3f& p : ringed.scan.points_lidar) {
      const double turns = std::atan2(p.y(), p.x()) / (2.0 * pi);
      const float range_m = 4.0F + 0.5F * std::abs(p.z());
      p = p.normalized() * range_m;
      p.x() -= static_cast<float>(1.5 * turns);
    }
    EXPECT_LT(share_wrong(rings_from_order(ringed.scan, hdl_64e()), ringed.truth), 0.01)
        << "start " << start;
  }
}

TEST(RingsFromOrder, RefusesAFileStoredColumnByColumn) {
  RingedScan ringed = ring_after_ring(hdl_64e(), {});
  Scan by_column;
  for (std::size_t column = 0; column < 720; ++column) {
    for (std::size_t ring = 0; ring < 64; ++ring) {
      by_column.points_lidar.push_back(ringed.scan.points_lidar[ring * 720 + column]);
    }
  }
  EXPECT_TRUE(rings_from_order(by_column, hdl_64e()).empty());
  // assign_rings then goes by the elevation.
  EXPECT_EQ(assign_rings(by_column, hdl_64e()), rings_from_elevation(by_column, hdl_64e()));
}

TEST(RingsFromElevation, AgreesWithTheNearestBeamByBruteForce) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> coordinate(-40.0F, 40.0F), height(-25.0F, 25.0F);
  for (const SensorModel& sensor : {hdl_64e(), hdl_32e(), vlp_16()}) {
    Scan scan;
    for (int i = 0; i < 2000; ++i) {
      scan.points_lidar.emplace_back(coordinate(random), coordinate(random), height(random));
    }
    const auto rings = rings_from_elevation(scan, sensor);
    ASSERT_EQ(rings.size(), scan.size());
    for (std::size_t i = 0; i < scan.size(); ++i) {
      const Eigen::Vector3d p = scan.points_lidar[i].cast<double>();
      const double elevation = std::atan2(p.z(), std::hypot(p.x(), p.y()));
      const auto distance = [&](int ring) {
        return std::abs(sensor.beam_elevation(ring) - elevation);
      };
      double least = distance(0);
      for (int ring = 1; ring < sensor.rings; ++ring) least = std::min(least, distance(ring));
      // Half-way between beams in angle is not quite half-way for the slopes that are compared.
      EXPECT_NEAR(distance(rings[i]), least, 1e-5) << sensor.name << " point " << p.transpose();
    }
  }
}

TEST(AssignRings, TakesTheFieldAsItIsWhenItCountsFromTheTop) {
  RingedScan ringed = ring_after_ring(vlp_16(), {});
  ringed.scan.ring = ringed.truth;
  EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth);
}

TEST(AssignRings, ReversesAFieldThatCountsFromTheBottom) {
  RingedScan ringed = ring_after_ring(vlp_16(), {});
  for (const std::uint16_t ring : ringed.truth) {
    ringed.scan.ring.push_back(static_cast<std::uint16_t>(15 - ring));
  }
  EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth);
}

/// Beams that leave so far beside their place that the elevation alone takes them for others.
RingedScan blurred(const SensorModel& sensor) {
  RingedScan ringed = ring_after_ring(sensor, {});
  std::mt19937 random(3);
  std::normal_distribution<float> blur(0.0F, 0.02F);
  for (Eigen::Vector3f& p : ringed.scan.points_lidar) p.z() += blur(random) * p.head<2>().norm();
  return ringed;
}

/// A ring field of 16 rings.
std::vector<std::uint16_t> numbered(const std::vector<std::uint16_t>& rings, bool from_top,
                                    int step, int first) {
  std::vector<std::uint16_t> numbers;
  for (const int ring : rings)
    numbers.push_back(static_cast<std::uint16_t>(step * (from_top ? ring : 15 - ring) + first));
  return numbers;
}

TEST(AssignRings, TakesAFieldThatCountsFromOneOrSkipsNumbers) {
  for (const bool from_top : {true, false}) {
    for (const auto& [step, first] : {std::pair{1, 1}, {4, 3}, {2, 0}, {2, 2}}) {
      RingedScan ringed = blurred(vlp_16());
      ASSERT_GT(share_wrong(assign_rings(ringed.scan, vlp_16()), ringed.truth), 0.1);
      ringed.scan.ring = numbered(ringed.truth, from_top, step, first);
      EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth)
          << "every " << step << " from " << first << (from_top ? ", from the top" : "");
    }
  }
}

TEST(AssignRings, TakesAFieldOfWhichEdgeRingsSawNothing) {
  const std::ptrdiff_t one_ring = 720;
  for (const bool from_top : {true, false}) {
    for (const int first : {0, 1}) {
      for (const bool cut_top : {true, false}) {
        RingedScan ringed = blurred(vlp_16());
        ringed.scan.ring = numbered(ringed.truth, from_top, 1, first);
        const auto cut = [&](auto& values) {
          const auto begin = cut_top ? values.begin() : values.end() - one_ring;
          values.erase(begin, begin + one_ring);
        };
        cut(ringed.scan.points_lidar);
        cut(ringed.scan.ring);
        cut(ringed.truth);
        EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth)
            << "from " << first << (from_top ? ", from the top" : "")
            << (cut_top ? ", top cut" : ", bottom cut");
      }
    }
  }
}

TEST(AssignRings, DoesNotBelieveAFieldOfAnotherSensor) {
  RingedScan ringed = ring_after_ring(vlp_16(), {});
  ringed.scan.ring.assign(ringed.scan.size(), 40);
  EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth);
}

TEST(AssignRings, DoesNotBelieveAFieldThatTellsNothing) {
  RingedScan ringed = ring_after_ring(vlp_16(), {});
  ringed.scan.ring.assign(ringed.scan.size(), 0);
  EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth);
}

TEST(AssignRings, TakesTheOrderWhereTheSensorSaysSo) {
  const RingedScan ringed = ring_after_ring(hdl_64e(), {.dropped = 0.2});
  EXPECT_EQ(assign_rings(ringed.scan, hdl_64e()), ringed.truth);
}

TEST(AssignRings, IsSafeOnBadPoints) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float inf = std::numeric_limits<float>::infinity();
  Scan scan;
  EXPECT_TRUE(assign_rings(scan, hdl_64e()).empty());
  scan.points_lidar = {{nan, nan, nan},    {inf, 0.0F, 1.0F},   {0.0F, 0.0F, 0.0F},
                       {0.0F, 0.0F, 9.0F}, {0.0F, 0.0F, -9.0F}, {1.0F, -inf, inf}};
  for (const SensorModel& sensor : {hdl_64e(), vlp_16()}) {
    const auto rings = assign_rings(scan, sensor);
    ASSERT_EQ(rings.size(), scan.size());
    for (const std::uint16_t ring : rings) EXPECT_LT(ring, sensor.rings);
    EXPECT_EQ(rings[1], 0);
    EXPECT_EQ(rings[3], 0);
    EXPECT_EQ(rings[4], sensor.rings - 1);
  }
}

TEST(AssignRings, GivesOneRingToPointsThatAreAllEqual) {
  Scan scan;
  scan.points_lidar.assign(1000, {5.0F, 1.0F, -1.0F});
  const auto rings = assign_rings(scan, hdl_64e());
  EXPECT_THAT(rings, testing::Each(rings.front()));
}

TEST(AssignRings, TakesAFieldThatSkipsNumbersThoughHalfOfTheRingsSawNothing) {
  const std::ptrdiff_t one_ring = 720;
  for (const bool from_top : {true, false}) {
    for (const auto& [step, first] : {std::pair{2, 0}, {2, 1}, {2, 2}, {4, 3}}) {
      for (const int seen : {2, 7, 8, 9}) {
        for (const bool sees_top : {true, false}) {
          RingedScan ringed = blurred(vlp_16());
          ringed.scan.ring = numbered(ringed.truth, from_top, step, first);
          const auto cut = [&](auto& values) {
            if (sees_top) values.erase(values.begin() + seen * one_ring, values.end());
            if (!sees_top) values.erase(values.begin(), values.end() - seen * one_ring);
          };
          cut(ringed.scan.points_lidar);
          cut(ringed.scan.ring);
          cut(ringed.truth);
          EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth)
              << "every " << step << " from " << first << (from_top ? ", from the top, " : ", ")
              << seen << " rings" << (sees_top ? " of the top" : " of the bottom");
        }
      }
    }
  }
}

TEST(AssignRings, KeepsTheEndThatAFieldCountsFromBesideAPointOnTheAxis) {
  for (const bool from_top : {true, false}) {
    for (const float height_m : {3.0F, -3.0F, -0.02F}) {
      RingedScan ringed = blurred(vlp_16());
      ringed.scan.ring = numbered(ringed.truth, from_top, 1, 0);
      for (const int ring : {0, 15}) {
        ringed.scan.points_lidar.emplace_back(1e-6F, 0.0F, height_m);
        ringed.scan.ring.push_back(static_cast<std::uint16_t>(ring));
        ringed.truth.push_back(static_cast<std::uint16_t>(from_top ? ring : 15 - ring));
        EXPECT_EQ(assign_rings(ringed.scan, vlp_16()), ringed.truth)
            << height_m << " m above, ring " << ring << (from_top ? ", from the top" : "");
      }
    }
  }
}

TEST(AssignRings, TakesTheNumberOfPointsThatWereNotMeasuredForNoRing) {
  for (const bool from_top : {true, false}) {
    for (const int no_ring : {255, 65535}) {
      RingedScan ringed = blurred(vlp_16());
      ringed.scan.ring = numbered(ringed.truth, from_top, 1, 0);
      for (std::size_t i = 0; i < ringed.scan.size(); i += 3) {
        ringed.scan.points_lidar[i].setZero();
        ringed.scan.ring[i] = static_cast<std::uint16_t>(no_ring);
      }
      const auto rings = assign_rings(ringed.scan, vlp_16());
      ASSERT_EQ(rings.size(), ringed.scan.size());
      for (std::size_t i = 0; i < rings.size(); ++i)
        ASSERT_EQ(rings[i], i % 3 > 0 ? ringed.truth[i] : (from_top ? 0 : 15)) << no_ring;
    }
  }
}

}  // namespace
}  // namespace stillmap
