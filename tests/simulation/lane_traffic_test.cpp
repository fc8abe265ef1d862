#include "core/simulation/lane_traffic.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace stillmap::simulation {
namespace {

class Lane : public testing::Test {
 protected:
  CityPlan plan_ = test_yard();
  GroundShape ground_{plan_, 3};
  Path lane_ = route_path(ground_, false, plan_.route_profile.lane_centre_m(0));
};

TEST_F(Lane, PositionsGoRoundAndAreArcLengths) {
  EXPECT_NEAR(lane_.wrapped(-1.0), lane_.length_m() - 1.0, 1e-9);
  const auto point = [&](double s) { return ground_.to_map(lane_.at(s).plan); };
  EXPECT_NEAR((point(lane_.length_m() + 2.0) - point(2.0)).norm(), 0.0, 1e-9);
  double length = 0.0;
  for (double s = 0.0; s < lane_.length_m(); s += 0.5) length += (point(s + 0.5) - point(s)).norm();
  EXPECT_NEAR(length, lane_.length_m(), 1.0);
}

TEST_F(Lane, NearestFindsASpotAgain) {
  for (double s = 1.0; s < lane_.length_m(); s += 7.3) {
    EXPECT_NEAR(std::remainder(lane_.nearest(lane_.at(s).plan) - s, lane_.length_m()), 0.0, 0.3);
  }
}

TEST_F(Lane, CurvatureIsThatOfTheTurns) {
  const double radius = plan_.turn_radius_m + plan_.route_profile.lane_centre_m(0);
  double sharpest = 0.0;
  for (double s = 0.0; s < lane_.length_m(); s += 0.25) {
    sharpest = std::max(sharpest, lane_.curvature(s));
  }
  EXPECT_NEAR(sharpest, 1.0 / radius, 0.3 / radius);
}

TEST_F(Lane, NobodyTouchesTheOneAhead) {
  std::vector<LaneUser> users;
  for (int i = 0; i < 12; ++i) {
    users.push_back({i * lane_.length_m() / 12.0, i % 3 == 0 ? 11.8 : 4.5, 6.0 + i});
  }
  const std::vector<StopLine> stops{{20.0, {30.0, 12.0, 0.0}}, {120.0, {30.0, 12.0, 9.0}}};
  const auto tracks = drive_lane(lane_, users, stops, {}, {-5.0, 90.0});
  double furthest = 0.0;
  for (double t = -5.0; t < 90.0; t += 0.05) {
    for (std::size_t i = 0; i < users.size(); ++i) {
      const std::size_t next = (i + 1) % users.size();
      const double apart = lane_.wrapped(tracks[next].position_at(t) - tracks[i].position_at(t));
      EXPECT_GT(apart, 0.5 * (users[i].length_m + users[next].length_m) + 0.3) << t << ' ' << i;
      EXPECT_GE(tracks[i].speed_at(t), 0.0);
    }
    furthest = std::max(furthest, tracks[0].position_at(t));
  }
  EXPECT_GT(furthest, 100.0) << "the lane must flow";
}

TEST_F(Lane, RedLightStopsAndGreenReleases) {
  const std::vector<StopLine> stops{{50.0, {1000.0, 20.0, 0.0}}};
  const auto tracks = drive_lane(lane_, {{5.0, 4.5, 8.0}}, stops, {}, {0.0, 60.0});
  EXPECT_LT(tracks[0].position_at(19.0) + 2.25, 50.0);
  EXPECT_LT(tracks[0].speed_at(19.0), 0.3);
  EXPECT_GT(tracks[0].position_at(40.0), 60.0);
}

TEST_F(Lane, SlowsDownInTurns) {
  const auto tracks = drive_lane(lane_, {{0.0, 4.5, 15.0}}, {}, {}, {0.0, 60.0});
  double worst = 0.0;
  for (double t = 5.0; t < 60.0; t += 0.1) {
    const double v = tracks[0].speed_at(t);
    worst = std::max(worst, v * v * lane_.curvature(tracks[0].position_at(t)));
  }
  EXPECT_LT(worst, 3.0) << "side acceleration [m/s^2]";
}

TEST(Track, IsSmoothBetweenItsKnots) {
  Track track(0.0);
  for (int i = 0; i < 20; ++i) track.add(0.5 * 2.0 * std::pow(i * 0.1, 2), 2.0 * i * 0.1);
  for (double t = 0.0; t < 1.9; t += 0.013) {
    EXPECT_NEAR(track.position_at(t), t * t, 1e-9);
    EXPECT_NEAR(track.speed_at(t), 2.0 * t, 1e-9);
  }
  EXPECT_NEAR(track.position_at(100.0), 1.9 * 1.9, 1e-9);
}

TEST(TrafficLight, IsRedAtTheStartOfEveryPeriod) {
  const TrafficLight light{30.0, 10.0, 5.0};
  EXPECT_TRUE(light.is_red(-5.0));
  EXPECT_TRUE(light.is_red(4.9));
  EXPECT_FALSE(light.is_red(5.1));
  EXPECT_TRUE(light.is_red(25.1));
  EXPECT_FALSE(light.is_red(-5.1));
}

}  // namespace
}  // namespace stillmap::simulation
