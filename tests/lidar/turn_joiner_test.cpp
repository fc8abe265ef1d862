#include "core/lidar/turn_joiner.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

namespace stillmap {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::int64_t turn_ms = 1'000'000;

/// What is seen of a wall round the lidar, anticlockwise from an azimuth [degrees], two points a
/// degree in two rings.
Scan cloud_of_arc(double stamp_ms, double from_deg, double width_deg) {
  Scan cloud;
  cloud.stamp_ns = std::llround(stamp_ms * static_cast<double>(turn_ms));
  for (double azimuth_deg = from_deg; azimuth_deg < from_deg + width_deg; azimuth_deg += 0.5) {
    const double azimuth = azimuth_deg * std::numbers::pi / 180.0;
    for (std::uint16_t ring = 0; ring < 2; ++ring) {
      cloud.points_lidar.emplace_back(static_cast<float>(10.0 * std::cos(azimuth)),
                                      static_cast<float>(10.0 * std::sin(azimuth)), 1.0F - ring);
      cloud.ring.push_back(ring);
    }
  }
  return cloud;
}

/// Clouds of an arc that goes on by `step_deg` every 50 ms.
std::vector<Scan> parts_of_turns(int clouds, double step_deg, double width_deg) {
  std::vector<Scan> parts;
  for (int k = 0; k < clouds; ++k)
    parts.push_back(cloud_of_arc(50.0 * k, 17.0 + step_deg * k, width_deg));
  return parts;
}

/// Stamps of the scans that a joiner makes of clouds, with a number of points a degree.
struct Joined {
  std::vector<double> stamps_ms;
  std::vector<std::size_t> points;
};

Joined joined(const std::vector<Scan>& clouds, TurnJoiner joiner = TurnJoiner()) {
  Joined all;
  const auto take = [&all](const std::vector<Scan>& scans) {
    for (const Scan& scan : scans) {
      all.stamps_ms.push_back(static_cast<double>(scan.stamp_ns) / turn_ms);
      all.points.push_back(scan.size());
    }
  };
  for (const Scan& cloud : clouds) take(joiner.add(cloud));
  take(joiner.flush());
  return all;
}

std::size_t all_points(const std::vector<Scan>& clouds) {
  return std::accumulate(clouds.begin(), clouds.end(), std::size_t{0},
                         [](std::size_t sum, const Scan& cloud) { return sum + cloud.size(); });
}

TEST(ViewedArc, IsTheSmallestThatHoldsAllDirections) {
  const auto across_the_seam = viewed_arc(cloud_of_arc(0.0, 150.2, 100.0).points_lidar);
  ASSERT_TRUE(across_the_seam);
  EXPECT_NEAR(across_the_seam->begin_deg, 150.0, 1.0);
  EXPECT_NEAR(across_the_seam->width_deg, 100.0, 2.0);
  const auto all_round = viewed_arc(cloud_of_arc(0.0, 10.0, 360.0).points_lidar);
  ASSERT_TRUE(all_round);
  EXPECT_GT(all_round->width_deg, 358.0);
  EXPECT_FALSE(viewed_arc({}));
  std::vector<Eigen::Vector3f> unmeasured(100, Eigen::Vector3f::Zero());
  unmeasured.emplace_back(NAN, NAN, NAN);
  EXPECT_FALSE(viewed_arc(unmeasured));
}

TEST(JoinedTurn, KeepsTimesAndRings) {
  Scan first = cloud_of_arc(100.0, 0.0, 180.0), second = cloud_of_arc(150.0, 180.0, 180.0);
  Scan turn = joined_turn({first, second});
  // Points of a simulator's tick are all of its stamp.
  EXPECT_EQ(turn.stamp_ns, first.stamp_ns);
  ASSERT_THAT(turn.time_offset_s, SizeIs(first.size() + second.size()));
  EXPECT_FLOAT_EQ(turn.time_offset_s.front(), 0.0F);
  EXPECT_FLOAT_EQ(turn.time_offset_s.back(), 0.05F);
  EXPECT_THAT(turn.ring, SizeIs(turn.size()));
  // Those of a driver are measured one after the other.
  first.time_offset_s.assign(first.size(), 0.01F);
  second.time_offset_s.assign(second.size(), 0.02F);
  turn = joined_turn({first, second});
  EXPECT_FLOAT_EQ(turn.time_offset_s.front(), 0.01F);
  EXPECT_FLOAT_EQ(turn.time_offset_s.back(), 0.07F);
}

TEST(TurnJoiner, JoinsHalvesFromTheFirstOn) {
  const std::vector<Scan> halves = parts_of_turns(12, 180.0, 180.0);
  const auto [stamps_ms, points] = joined(halves);
  EXPECT_THAT(stamps_ms, ElementsAre(0, 100, 200, 300, 400, 500));
  EXPECT_THAT(points, Each(2 * halves.front().size()));
}

struct PartsCase {
  const char* name;
  double step_deg;
  double width_deg;
  std::size_t clouds_per_turn;
};

class TurnsInParts : public testing::TestWithParam<PartsCase> {};

TEST_P(TurnsInParts, AreCounted) {
  const auto& [name, step_deg, width_deg, clouds_per_turn] = GetParam();
  TurnJoiner joiner;
  std::size_t scans = 0;
  for (const Scan& cloud : parts_of_turns(120, step_deg, width_deg))
    scans += joiner.add(cloud).size();
  EXPECT_EQ(joiner.clouds_per_turn(), clouds_per_turn);
  EXPECT_EQ(scans, 120 / clouds_per_turn);
}

INSTANTIATE_TEST_SUITE_P(All, TurnsInParts,
                         testing::Values(PartsCase{"Halves", 180.0, 180.0, 2},
                                         PartsCase{"HalvesClockwise", -180, 180, 2},
                                         PartsCase{"Thirds", 120.0, 120.0, 3},
                                         PartsCase{"Quarters", -90.0, 90.0, 4},
                                         PartsCase{"Twelfths", 30.0, 30.0, 12},
                                         PartsCase{"TwelfthsOfBeamsOutOfLine", 30.0, 38.0, 12},
                                         PartsCase{"SixthsOfBeamsOutOfLine", 60.0, 76.0, 6},
                                         PartsCase{"SeamThatWanders", 200.0, 200.0, 2},
                                         PartsCase{"SmallPartsThatWander", 110.0, 110.0, 3},
                                         PartsCase{"TwoThirds", 240.0, 240.0, 2},
                                         PartsCase{"GapsBetweenParts", 180.0, 172.0, 2},
                                         PartsCase{"NearlyAllRound", 324.0, 324.0, 1},
                                         PartsCase{"TwoLidarsThatMeet", 180.0, 200.0, 2}),
                         [](const auto& info) { return std::string(info.param.name); });

TEST(TurnJoiner, JoinsPartsOfWhatTheRobotHidesInPart) {
  // 90 degrees behind the lidar show nothing.
  for (const double seam_deg : {-180.0, -90.0, -20.0}) {
    std::vector<Scan> halves;
    for (int k = 0; k < 12; ++k) {
      Scan half = cloud_of_arc(50.0 * k, seam_deg + 180.0 * k, 180.0);
      std::erase_if(half.points_lidar, [](const Eigen::Vector3f& p) { return p.x() < -7.07F; });
      half.ring.clear();
      halves.push_back(std::move(half));
    }
    EXPECT_THAT(joined(halves).stamps_ms, ElementsAre(0, 100, 200, 300, 400, 500)) << seam_deg;
  }
}

TEST(TurnJoiner, CountsPartsThatTheRobotHides) {
  // The rear 90 degrees: of twelve parts three show nothing.
  TurnJoiner joiner;
  std::size_t scans = 0;
  for (int k = 0; k < 120; ++k) {
    Scan part = cloud_of_arc(8.0 * k, 17.0 + 30.0 * k, 30.0);
    std::erase_if(part.points_lidar, [](const Eigen::Vector3f& p) { return p.x() < -7.07F; });
    part.ring.clear();
    scans += joiner.add(part).size();
  }
  EXPECT_EQ(joiner.clouds_per_turn(), 12U);
  EXPECT_EQ(scans, 10U);
}

TEST(TurnJoiner, NeverKeepsCloudsForLong) {
  const auto longest_wait_ms = [](auto cloud_at) {
    TurnJoiner joiner;
    double longest_ms = 0.0;
    for (int k = 0; k < 300; ++k) {
      const Scan cloud = cloud_at(k);
      for (const Scan& scan : joiner.add(cloud))
        longest_ms =
            std::max(longest_ms, static_cast<double>(cloud.stamp_ns - scan.stamp_ns) / turn_ms);
    }
    return longest_ms;
  };
  // Two lidars that take turns, not in the middle of each other's.
  EXPECT_LE(longest_wait_ms([](int k) {
              return cloud_of_arc(50.0 * k - 20.0 * (k % 2), 17.0 + 180.0 * k, 180.0);
            }),
            500.0);
  // A few things near the lidar, and then nothing.
  EXPECT_LE(
      longest_wait_ms([](int k) { return cloud_of_arc(100.0 * k, 0.0, k == 0 ? 40.0 : 2.0); }),
      2200.0);
}

TEST(TurnJoiner, LetsWholeTurnsPassAtOnce) {
  TurnJoiner joiner;
  for (int k = 0; k < 5; ++k)
    EXPECT_THAT(joiner.add(cloud_of_arc(100.0 * k, 0.0, 360.0)), SizeIs(1)) << k;
}

TEST(TurnJoiner, NeverJoinsCloudsOfALidarThatLooksOneWay) {
  for (const double width_deg : {20.0, 70.0, 120.0, 180.0, 270.0}) {
    TurnJoiner joiner;
    EXPECT_THAT(joiner.add(cloud_of_arc(0.0, -60.0, width_deg)), IsEmpty());
    EXPECT_THAT(joiner.add(cloud_of_arc(100.0, -60.0, width_deg)), SizeIs(2));
    for (int k = 2; k < 40; ++k)
      EXPECT_THAT(joiner.add(cloud_of_arc(100.0 * k, -60.0 + k % 3, width_deg)), SizeIs(1));
  }
  // Of 120 degrees it sees what stands there, now in one corner and now in another.
  TurnJoiner joiner;
  std::size_t scans = 0;
  for (int k = 0; k < 60; ++k)
    scans += joiner.add(cloud_of_arc(100.0 * k, 37.0 * (k * k % 4) - 60.0, 15.0)).size();
  EXPECT_EQ(joiner.clouds_per_turn(), 1U);
  EXPECT_GT(scans, 50U);
}

TEST(TurnJoiner, JoinsNothingAcrossWhatWasLost) {
  std::vector<Scan> halves = parts_of_turns(20, 180.0, 180.0);
  halves.erase(halves.begin() + 9);
  const auto stamps_ms = joined(halves).stamps_ms;
  EXPECT_THAT(stamps_ms, ElementsAre(0, 100, 200, 300, 400, 500, 600, 700, 800, 900));
  // The lidar stopped for a while within a turn.
  halves = parts_of_turns(9, 180.0, 180.0);
  for (int k = 0; k < 6; ++k)
    halves.push_back(cloud_of_arc(9000.0 + 50.0 * k, 17.0 + 180.0 * k, 180.0));
  EXPECT_THAT(joined(halves).stamps_ms, ElementsAre(0, 100, 200, 300, 400, 9000, 9100, 9200));
}

TEST(TurnJoiner, IsNotConfusedByJitterOrAClockThatIsSetBack) {
  std::vector<Scan> thirds = parts_of_turns(30, 120.0, 120.0);
  for (std::size_t k = 0; k < thirds.size(); ++k)
    thirds[k].stamp_ns += (k % 5 == 0 ? 12 : k % 7 == 0 ? -11 : 0) * turn_ms;
  auto [stamps_ms, points] = joined(thirds);
  EXPECT_THAT(points, SizeIs(10));
  EXPECT_THAT(points, Each(all_points(thirds) / 10));
  std::vector<Scan> halves = parts_of_turns(13, 180.0, 180.0);
  for (int k = 0; k < 4; ++k)
    halves.push_back(cloud_of_arc(50.0 * k - 5000.0, 197.0 + 180.0 * k, 180.0));
  EXPECT_THAT(joined(halves).stamps_ms, ElementsAre(0, 100, 200, 300, 400, 500, 600, -5000, -4900));
}

TEST(TurnJoiner, FollowsADriverThatIsSetToAnotherRate) {
  TurnJoiner joiner;
  int stamp_ms = 0;
  const auto add = [&](int clouds, double width_deg) {
    std::size_t scans = 0;
    for (int k = 0; k < clouds; ++k, stamp_ms += 50)
      scans += joiner.add(cloud_of_arc(stamp_ms, width_deg * k, width_deg)).size();
    return scans;
  };
  EXPECT_EQ(add(20, 180.0), 10U);
  (void)add(20, 360.0);
  EXPECT_EQ(add(20, 360.0), 20U);
  (void)add(20, 90.0);
  EXPECT_EQ(add(20, 90.0), 5U);
  EXPECT_EQ(joiner.clouds_per_turn(), 4U);
}

TEST(TurnJoiner, DoesAsItIsTold) {
  const std::vector<Scan> halves = parts_of_turns(8, 180.0, 180.0);
  EXPECT_THAT(joined(halves, TurnJoiner(1)).stamps_ms, SizeIs(8));
  EXPECT_THAT(joined(parts_of_turns(8, 0.0, 90.0), TurnJoiner(4)).stamps_ms, ElementsAre(0, 200));
}

TEST(TurnJoiner, TurnsOfMoreThanASecondStayInParts) {
  TurnJoiner joiner;
  std::size_t scans = 0;
  for (int k = 0; k < 40; ++k)
    scans += joiner.add(cloud_of_arc(600.0 * k, 180.0 * k, 180.0)).size();
  EXPECT_EQ(scans, 40U);
}

}  // namespace
}  // namespace stillmap
