#include "core/geodesy/gnss_delay.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace stillmap {
namespace {

/// What a lidar and a receiver say of a drive.
struct Heard {
  std::vector<PlanPose> way;
  std::vector<PlanFix> fixes;
};

/// Speed [m/s] and turn rate [rad/s] at a time.
struct Course {
  double (*speed_at)(double time_s);
  double (*turn_at)(double time_s);
};

/// 10 m/s and slower in turns to either side, and a stop at every third one.
constexpr Course town{
    [](double s) {
      const double phase_s = std::fmod(s, 14.0);
      if (phase_s < 9.0) return 10.0;
      return std::fmod(s, 42.0) > 40.0 ? 0.0 : 5.0;
    },
    [](double s) {
      const double phase_s = std::fmod(s, 14.0);
      return phase_s > 10.0 && phase_s < 13.0 ? (std::fmod(s, 70.0) < 42.0 ? 0.52 : -0.52) : 0.0;
    }};
constexpr Course motorway{[](double) { return 30.0; }, [](double) { return 0.0; }};
constexpr Course roundabout{[](double) { return 8.0; }, [](double) { return 0.4; }};

/// Scans at 10 Hz by odometry that turns too far, fixes at 5 Hz.
Heard driven(const Course& course, double duration_s, double delay_s, double sigma_m,
             const Eigen::Vector2d& antenna_lidar = {0, 0}) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, sigma_m);
  Heard heard;
  constexpr double step_s = 0.01;
  Eigen::Vector2d at = Eigen::Vector2d::Zero(), at_odom = at;
  double heading_rad = 0.3, heading_odom_rad = 0.0;
  for (int k = 0; k * step_s < duration_s; ++k) {
    const double time_s = k * step_s;
    const Eigen::Matrix2d axes = Eigen::Rotation2D<double>(heading_rad).toRotationMatrix();
    const Eigen::Matrix2d axes_odom =
        Eigen::Rotation2D<double>(heading_odom_rad).toRotationMatrix();
    if (k % 10 == 0) heard.way.push_back({std::llround(time_s * 1e9), at_odom, axes_odom});
    if (k % 20 == 3) {
      const Eigen::Vector2d position = at + axes * antenna_lidar;
      heard.fixes.push_back({std::llround((time_s + delay_s) * 1e9),
                             position + Eigen::Vector2d(noise(random), noise(random)),
                             std::max(sigma_m, 0.02)});
    }
    const double way_m = course.speed_at(time_s) * step_s;
    at += way_m * axes.col(0);
    at_odom += 1.001 * way_m * axes_odom.col(0);
    heading_rad += course.turn_at(time_s) * step_s;
    heading_odom_rad += course.turn_at(time_s) * step_s + 3e-5 * way_m;
  }
  return heard;
}

TEST(GnssDelay, IsFoundByTurnsAndStops) {
  for (const double delay_s : {0.0, 0.033, 0.05, 0.27, 0.3, -0.5, 17.77, 18.0, -18.0, 37.02}) {
    const Heard heard = driven(town, 150.0, delay_s, 0.02);
    const auto found = estimate_delay(heard.way, heard.fixes);
    ASSERT_TRUE(found) << delay_s;
    EXPECT_NEAR(found->delay_s, delay_s, 0.01);
    EXPECT_LT(found->sigma_s, 0.01);
    EXPECT_TRUE(found->antenna_lidar.isZero());
  }
}

TEST(GnssDelay, IsAsSureAsItIsRight) {
  for (const double delay_s : {0.0, 0.3, -18.0}) {
    const Heard heard = driven(town, 300.0, delay_s, 1.5);
    const auto found = estimate_delay(heard.way, heard.fixes);
    ASSERT_TRUE(found) << delay_s;
    EXPECT_LT(std::abs(found->delay_s - delay_s), 3.0 * found->sigma_s);
    EXPECT_LT(found->sigma_s, 0.1);
  }
}

// As of a receiver without corrections: what it errs by stays the same for a minute.
TEST(GnssDelay, IsAsSureAsItIsRightOfAReceiverThatWanders) {
  for (const double delay_s : {0.0, 0.27, 17.77}) {
    Heard heard = driven(town, 400.0, delay_s, 0.1);
    std::mt19937 random(9);
    constexpr double sigma_m = 1.5, correlation_s = 60.0, step_s = 0.2;
    std::normal_distribution<double> step(0.0, sigma_m * std::sqrt(2.0 * step_s / correlation_s));
    Eigen::Vector2d error_m(sigma_m, -sigma_m);
    for (PlanFix& fix : heard.fixes) {
      error_m =
          (1.0 - step_s / correlation_s) * error_m + Eigen::Vector2d(step(random), step(random));
      fix.position_enu += error_m;
      fix.sigma_m = sigma_m;
    }
    const auto found = estimate_delay(heard.way, heard.fixes);
    ASSERT_TRUE(found) << delay_s;
    EXPECT_LT(std::abs(found->delay_s - delay_s), 3.0 * found->sigma_s) << delay_s;
    EXPECT_LT(found->sigma_s, 0.1) << delay_s;
  }
}

TEST(GnssDelay, IsToldFromAnAntennaThatIsElsewhere) {
  const Heard heard = driven(town, 300.0, 0.2, 0.02, {2.5, -0.8});
  const auto found = estimate_delay(heard.way, heard.fixes, {.antenna_sigma_m = 1.0});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->delay_s, 0.2, 0.02);
  EXPECT_LT((found->antenna_lidar - Eigen::Vector2d(2.5, -0.8)).norm(), 0.1);
  EXPECT_LT(found->antenna_sigma_m, 0.1);
}

// There a delay is another place of the map.
TEST(GnssDelay, IsNotKnownWhereSpeedAndTurnAreTheSameAllTheTime) {
  for (const Course& course : {motorway, roundabout}) {
    for (const double delay_s : {0.0, 0.5}) {
      const Heard heard = driven(course, 120.0, delay_s, 0.02);
      const auto found = estimate_delay(heard.way, heard.fixes);
      EXPECT_TRUE(!found || std::abs(found->delay_s) < 4.0 * found->sigma_s);
    }
  }
}

/// A turn by a right angle, to either side by turns, and slower in it; else straight on.
template <int period_s, int speed_m_s>
constexpr Course rare_turns{[](double s) {
                              return std::fmod(s, period_s) > period_s - 8 ? 0.5 * speed_m_s
                                                                           : 1.0 * speed_m_s;
                            },
                            [](double s) {
                              const double phase_s = std::fmod(s, period_s);
                              if (phase_s <= period_s - 6 || phase_s >= period_s - 2) return 0.0;
                              return std::fmod(s, 2 * period_s) < period_s ? 0.39 : -0.39;
                            }};

TEST(GnssDelay, IsFoundByTurnsThatAreRare) {
  const auto expect_found = [](const Course& course, double delay_s, double sigma_m) {
    const Heard heard = driven(course, 600.0, delay_s, sigma_m);
    const auto found = estimate_delay(heard.way, heard.fixes);
    ASSERT_TRUE(found && revised({}, *found)) << delay_s << " s, " << sigma_m << " m";
    EXPECT_NEAR(found->delay_s, delay_s, std::max(0.01, 3.0 * found->sigma_s));
  };
  for (const double delay_s : {2.0, 18.0}) {
    for (const double sigma_m : {0.02, 1.5}) {
      expect_found(rare_turns<30, 8>, delay_s, sigma_m);
      expect_found(rare_turns<60, 15>, delay_s, sigma_m);
      expect_found(rare_turns<90, 15>, delay_s, sigma_m);
    }
  }
}

/// A street by odometry that errs from scan to scan, and of a receiver that sees reflections for
/// six seconds, by some metres.
Heard driven_straight(unsigned seed, double sigma_m) {
  constexpr Course street{[](double) { return 8.0; }, [](double) { return 0.0; }};
  Heard heard = driven(street, 90.0, 0.0, sigma_m);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  double heading_rad = 0.0;
  Eigen::Vector2d off_m = Eigen::Vector2d::Zero();
  for (std::size_t i = 1; i < heard.way.size(); ++i) {
    heading_rad += 0.0003 * normal(random);
    off_m += 0.0035 * Eigen::Vector2d(normal(random), normal(random));
    off_m.y() += 0.8 * heading_rad;
    heard.way[i].antenna_odom += off_m;
    heard.way[i].axes_odom = Eigen::Rotation2D<double>(heading_rad) * heard.way[i].axes_odom;
  }
  const std::size_t first = 30 * (seed % 12), count = 30;
  const Eigen::Vector2d reflected_m =
      8.0 * sigma_m * Eigen::Vector2d(normal(random), normal(random));
  for (std::size_t i = first; i < std::min(first + count, heard.fixes.size()); ++i)
    heard.fixes[i].position_enu += reflected_m;
  return heard;
}

TEST(GnssDelay, OnAStraightWayTheNoiseOfOdometryTellsNothing) {
  for (const double sigma_m : {0.02, 1.5}) {
    for (unsigned seed = 0; seed < 24; ++seed) {
      const Heard heard = driven_straight(seed, sigma_m);
      const auto found = estimate_delay(heard.way, heard.fixes);
      EXPECT_TRUE(!found || !revised({}, *found))
          << sigma_m << " m, " << seed << ": " << found->delay_s << " +- " << found->sigma_s;
    }
  }
}

// An estimate that is less sure than the one before it says nothing against that.
TEST(GnssDelay, IsKeptUntilItIsContradicted) {
  const GnssDelay known{.delay_s = 0.3, .sigma_s = 0.02, .antenna_lidar = {1.0, 0.5}};
  const auto later = [&](double delay_s, double sigma_s) {
    GnssDelay found = known;
    found.delay_s = delay_s;
    found.sigma_s = sigma_s;
    return found;
  };
  EXPECT_FALSE(revised(known, later(0.28, 0.08)));
  GnssDelay unsure = later(0.3, 0.02);
  unsure.antenna_lidar = {0.9, 0.4};
  unsure.antenna_sigma_m = 0.4;
  EXPECT_FALSE(revised(known, unsure));
  EXPECT_DOUBLE_EQ(revised(known, later(0.25, 0.01)).value().delay_s, 0.25);
  EXPECT_EQ(revised(known, later(0.05, 0.05)).value().delay_s, 0.0) << "there is none after all";
  EXPECT_EQ(revised(known, later(0.05, 0.05)).value().antenna_lidar, known.antenna_lidar);
  EXPECT_FALSE(revised({}, {.delay_s = 0.28, .sigma_s = 0.08})) << "not known yet";
  EXPECT_DOUBLE_EQ(revised({}, {.delay_s = 0.28, .sigma_s = 0.02}).value().delay_s, 0.28);
}

TEST(GnssDelay, NothingTellsNothing) {
  EXPECT_FALSE(estimate_delay({}, {}));
  const Heard heard = driven(town, 5.0, 0.1, 0.02);
  EXPECT_FALSE(estimate_delay(heard.way, heard.fixes));
  EXPECT_FALSE(estimate_delay({}, driven(town, 60.0, 0.1, 0.02).fixes));
}

}  // namespace
}  // namespace stillmap
