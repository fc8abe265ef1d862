#include "core/graph/position_chains.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <span>
#include <vector>

namespace stillmap {
namespace {

/// Of a drive of 600 m in a wide curve, every metre.
Eigen::Vector3d place(int k) {
  const double angle = k / 200.0;
  return {200.0 * std::sin(angle), 200.0 * (1.0 - std::cos(angle)), 0.0};
}

PositionOnWay measured(int k, const Eigen::Vector3d& position_enu, double sigma_m = 1.0) {
  PositionOnWay position;
  position.measured.node = static_cast<std::size_t>(k);
  position.measured.position_enu = position_enu;
  position.measured.information = Eigen::Matrix3d::Identity() / (sigma_m * sigma_m);
  position.point_odom = place(k);
  position.way_m = k;
  return position;
}

/// Chains of 600 positions, each as `say` has it of the true one.
PositionChains chains_of(const std::function<Eigen::Vector3d(int, const Eigen::Vector3d&)>& say) {
  PositionChains chains(5.0, 10.0);
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (int k = 0; k < 600; ++k) {
    const Eigen::Vector3d error(noise(random), noise(random), noise(random));
    chains.add(measured(k, say(k, place(k) + error)));
  }
  return chains;
}

/// How many of them say how high they are.
std::size_t heights(std::span<const PositionMeasurement> positions) {
  return static_cast<std::size_t>(std::ranges::count_if(
      positions,
      [](const PositionMeasurement& position) { return position.information(2, 2) > 1e-4; }));
}

TEST(PositionChains, AllOfAGoodReceiverAreOne) {
  PositionChains chains = chains_of([](int, const Eigen::Vector3d& p) { return p; });
  EXPECT_EQ(heights(chains.believed()), chains.believed().size());
  EXPECT_GE(chains.believed().size(), 55U);
  EXPECT_LE(chains.disbelieved(), 3U);
}

TEST(PositionChains, AReceiverThatHoldsItsPositionIsNotBelieved) {
  const Eigen::Vector3d held = place(250);
  PositionChains chains =
      chains_of([&](int k, const Eigen::Vector3d& p) { return k < 250 ? p : held; });
  ASSERT_FALSE(chains.believed().empty());
  EXPECT_GE(chains.believed().size(), 20U);
  EXPECT_LT(chains.believed().back().node, 262U);
  EXPECT_GT(chains.disbelieved(), 25U);
}

TEST(PositionChains, WhatHoldsItsPositionFromTheBeginningOnMakesNoChain) {
  PositionChains chains =
      chains_of([](int, const Eigen::Vector3d&) { return Eigen::Vector3d(1.0, 2.0, 3.0); });
  EXPECT_LE(chains.believed().size(), 3U);
}

TEST(PositionChains, WhatIsSaidBeforeTheReceiverIsRightIsNotBelieved) {
  PositionChains chains =
      chains_of([](int k, const Eigen::Vector3d& p) { return k < 150 ? (0.2 * p).eval() : p; });
  ASSERT_GE(chains.believed().size(), 35U);
  EXPECT_GE(chains.believed()[2].node, 150U);
}

TEST(PositionChains, WhatIsOffByTheSameSinceSomeMomentIsAnotherOne) {
  PositionChains chains = chains_of([](int k, const Eigen::Vector3d& p) {
    return (k < 350 ? p : p + Eigen::Vector3d(-2.0, 12.0, 0.0)).eval();
  });
  EXPECT_GE(chains.believed().size(), 30U);
  EXPECT_LT(chains.believed().back().node, 350U);
}

TEST(PositionChains, AStepInHeightTakesHeightsAlone) {
  for (const double step_m : {-20.0, 10.0}) {
    PositionChains chains = chains_of([&](int k, const Eigen::Vector3d& p) {
      return (k < 350 ? p : p + Eigen::Vector3d(0.0, 0.0, step_m)).eval();
    });
    const auto believed = chains.believed();
    EXPECT_GE(believed.size(), 55U) << step_m;
    EXPECT_GE(heights(believed), 30U) << step_m;
    for (const PositionMeasurement& position : believed) {
      const bool is_known = position.information(2, 2) > 1e-4;
      EXPECT_EQ(is_known, position.node < 350) << step_m;
      // Where the others would have it, so that it does not mislead what begins from there.
      EXPECT_NEAR(position.position_enu.z(), 0.0, 4.0) << step_m;
    }
  }
}

TEST(PositionChains, HeightsThatJumpAllTheTimeAreNotBelieved) {
  PositionChains chains = chains_of([](int k, const Eigen::Vector3d& p) {
    return (p + Eigen::Vector3d(0.0, 0.0, 25.0 * ((k / 10) % 7))).eval();
  });
  EXPECT_GE(chains.believed().size(), 55U);
  EXPECT_EQ(heights(chains.believed()), 0U);
}

/// Of heights that wander by metres from fix to fix, the first one off by so much more.
PositionChains chains_that_wander(double first_off_m) {
  PositionChains chains(5.0, 10.0);
  std::mt19937_64 random(4);
  std::normal_distribution<double> step_m(0.0, 0.4);
  double height_m = 0.0;
  for (int k = 0; k < 600; ++k) {
    height_m = 0.99 * height_m + step_m(random);
    const double off_m = height_m + (k == 0 ? first_off_m : 0.0);
    chains.add(measured(k, place(k) + Eigen::Vector3d(0.0, 0.0, off_m), 0.02));
  }
  return chains;
}

TEST(PositionChains, HeightsThatWanderByMetresAreNotBelieved) {
  PositionChains chains = chains_that_wander(0.0);
  EXPECT_GE(chains.believed().size(), 100U);
  EXPECT_EQ(heights(chains.believed()), 0U);
}

/// A fix every 1.6 m of a way of 3 km that bends to and fro, by a receiver whose
/// errors last, and of which something off sets in at once every 300 m and fades.
struct LongWay {
  double sigma_m = 1.0;
  double lasting = 0.99;
  Eigen::Vector3d off = Eigen::Vector3d::Zero();
  Eigen::AngleAxisd tilt = Eigen::AngleAxisd(0.0, Eigen::Vector3d::UnitX());
};

PositionChains chains_of(const LongWay& said, unsigned seed) {
  PositionChains chains(5.0, 10.0);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::uniform_real_distribution<double> direction(0.0, 6.28);
  Eigen::Vector3d error = Eigen::Vector3d::Zero(), off = error;
  for (int k = 0; k < 1875; ++k) {
    const Eigen::Vector3d step(normal(random), normal(random), normal(random));
    error =
        k == 0
            ? step
            : (said.lasting * error + std::sqrt(1.0 - said.lasting * said.lasting) * step).eval();
    off *= 0.9;
    if (k % 188 == 94)
      off = Eigen::AngleAxisd(direction(random), Eigen::Vector3d::UnitZ()) * said.off;
    const double x = 1.6 * k;
    const Eigen::Vector3d at(x, 20.0 * std::sin(x / 50.0), 3.0 * std::sin(x / 90.0));
    PositionOnWay position = measured(k, at + said.sigma_m * error + off, said.sigma_m);
    position.point_odom = said.tilt * at;
    position.way_m = x;
    chains.add(position);
  }
  return chains;
}

TEST(PositionChains, ReflectionsThatSetInAtOnceAndFadeTakeNothingAlong) {
  for (const double tilt_rad : {0.0, 1.0}) {
    const Eigen::AngleAxisd tilt(tilt_rad, Eigen::Vector3d(0.6, 0.8, 0.0));
    for (const double sigma_m : {0.05, 1.0}) {
      for (unsigned seed = 0; seed < 3; ++seed) {
        PositionChains chains = chains_of(
            {.sigma_m = sigma_m, .off = {8.0 * sigma_m + 4.0, 0.0, 0.0}, .tilt = tilt}, seed);
        const std::size_t all = sigma_m < 0.5 ? 469 : 268;
        EXPECT_GE(chains.believed().size(), all * 9 / 10)
            << tilt_rad << ' ' << sigma_m << ' ' << seed << ' ' << chains.disbelieved();
      }
    }
  }
}

TEST(PositionChains, HeightsThatAreOffAtOnceAndFadeTakeNothingAlong) {
  for (const double sigma_m : {0.05, 1.0}) {
    for (unsigned seed = 0; seed < 3; ++seed) {
      PositionChains chains =
          chains_of({.sigma_m = sigma_m, .off = {0.0, 0.0, 8.0 * sigma_m + 4.0}}, seed);
      const auto believed = chains.believed();
      EXPECT_EQ(chains.disbelieved(), 0U);
      EXPECT_GE(heights(believed), believed.size() * 7 / 10) << sigma_m;
    }
  }
}

TEST(PositionChains, NoiseFromFixToFixIsOneChain) {
  for (const double sigma_m : {1.0, 2.0}) {
    for (unsigned seed = 0; seed < 3; ++seed) {
      PositionChains chains = chains_of({.sigma_m = sigma_m, .lasting = 0.0}, seed);
      EXPECT_GE(chains.believed().size(), sigma_m < 1.5 ? 260U : 140U)
          << seed << ' ' << chains.disbelieved();
    }
  }
}

TEST(PositionChains, OneHeightOfTwelveMayBeOff) {
  std::vector<PositionOnWay> positions;
  for (int k = 0; k < 240; ++k) {
    positions.push_back(measured(k, {10.0 * k, 0.0, k % 12 == 6 ? 30.0 : 0.0}));
    positions.back().point_odom = {10.0 * k, 0.0, 0.0};
    positions.back().way_m = 10.0 * k;
  }
  const std::vector<bool> believed = believed_heights(positions);
  EXPECT_EQ(std::ranges::count(believed, true), 220);
}

// Without any of them, that of the first one alone would be all that tells.
TEST(PositionChains, WithoutHeightsTheyAreWhereMostHaveThem) {
  PositionChains chains = chains_that_wander(90.0);
  const auto believed = chains.believed();
  ASSERT_EQ(heights(believed), 0U);
  for (const PositionMeasurement& position : believed)
    EXPECT_NEAR(position.position_enu.z(), 0.0, 10.0);
}

// Without an IMU a map is as level as its first scan's lidar was.
TEST(PositionChains, OdometryMayBeTiltedAndATenthTooLong) {
  for (const double tilt_rad : {0.0, 0.5, 1.5}) {
    for (const double scale : {0.9, 1.0, 1.1}) {
      PositionChains chains(5.0, 10.0);
      const Eigen::AngleAxisd tilt(tilt_rad, Eigen::Vector3d(0.6, 0.8, 0.0));
      for (int k = 0; k < 600; ++k) {
        PositionOnWay position = measured(k, place(k), 0.02);
        position.point_odom = scale * (tilt * place(k));
        chains.add(position);
      }
      EXPECT_EQ(chains.disbelieved(), 0U) << tilt_rad << " rad, " << scale;
      EXPECT_EQ(heights(chains.believed()), chains.believed().size()) << tilt_rad;
    }
  }
}

TEST(PositionChains, AReceiverGoesOnWhereOdometryWasLost) {
  PositionChains chains(5.0, 10.0);
  for (int k = 0; k < 600; ++k) {
    PositionOnWay position = measured(k, place(k));
    // It has the robot 6 m from where it is since then.
    if (k >= 300) position.point_odom.x() += 6.0;
    position.unconfirmed_scans = k >= 300 ? 4 : 0;
    chains.add(position);
  }
  EXPECT_EQ(chains.disbelieved(), 0U);
}

TEST(PositionChains, ABetterOneReplacesTheNewestUntilItIsInUse) {
  for (const bool is_in_use : {false, true}) {
    PositionChains chains(5.0, 10.0);
    chains.add(measured(0, place(0)));
    if (is_in_use) (void)chains.believed();
    chains.add(measured(1, place(1), 0.1));
    ASSERT_EQ(chains.believed().size(), 1U);
    EXPECT_EQ(chains.believed()[0].node, is_in_use ? 0U : 1U);
  }
}

}  // namespace
}  // namespace stillmap
