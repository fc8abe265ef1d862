#include "core/inertial/imu_track.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace stillmap {
namespace {

constexpr std::int64_t ms = 1'000'000;

/// Turns that differ a little, as noise has it.
ImuSample turning_sample(std::int64_t stamp_ns, double rate_z) {
  const double noise = 1e-7 * static_cast<double>(stamp_ns / ms % 3);
  return {stamp_ns, {0.0, noise, rate_z}, {0.0, 0.0, 9.81}};
}

/// `rate(t)` about z at 200 Hz from 0 to 1 s.
template <typename Rate>
ImuTrack turning_track(Rate rate) {
  ImuTrack track;
  for (int k = 0; k <= 200; ++k)
    EXPECT_EQ(track.add(turning_sample(k * 5 * ms, rate(0.005 * k))), ImuSampleFate::taken);
  return track;
}

double yaw_between(const ImuTrack& track, std::int64_t from_ns, std::int64_t to_ns) {
  const auto R = track.rotation(from_ns, to_ns, Eigen::Vector3d::Zero());
  EXPECT_TRUE(R);
  return R ? rotation_vector(*R).z() : std::numeric_limits<double>::quiet_NaN();
}

TEST(ImuTrack, IntegratesRatesThatChange) {
  const ImuTrack track = turning_track([](double t) { return 2.0 * t; });
  EXPECT_NEAR(yaw_between(track, 0, 1000 * ms), 1.0, 1e-6);
  EXPECT_NEAR(yaw_between(track, 251 * ms, 503 * ms), 0.503 * 0.503 - 0.251 * 0.251, 1e-6);
  EXPECT_NEAR(yaw_between(track, 503 * ms, 251 * ms), 0.251 * 0.251 - 0.503 * 0.503, 1e-6);
  EXPECT_NEAR(yaw_between(track, 400 * ms, 400 * ms), 0.0, 1e-12);
}

TEST(ImuTrack, TurnsAboutAxesThatTurnWithIt) {
  // A quarter about x, then one about the new z.
  ImuTrack track;
  const double rate = 0.5 * M_PI;
  for (int k = 0; k <= 400; ++k) {
    ImuSample sample = turning_sample(k * 5 * ms, 0.0);
    sample.angular_velocity_imu[k < 200 ? 0 : 2] = rate;
    ASSERT_EQ(track.add(sample), ImuSampleFate::taken);
  }
  const auto R = track.rotation(0, 2000 * ms, Eigen::Vector3d::Zero());
  ASSERT_TRUE(R);
  const Eigen::Quaterniond expected = rotation_by(0.5 * M_PI * Eigen::Vector3d::UnitX()) *
                                      rotation_by(0.5 * M_PI * Eigen::Vector3d::UnitZ());
  EXPECT_LT(R->angularDistance(expected), 0.01);
}

TEST(ImuTrack, TakesTheBiasOff) {
  const ImuTrack track = turning_track([](double) { return 0.3; });
  const auto R = track.rotation(0, 1000 * ms, {0.0, 0.0, 0.3});
  ASSERT_TRUE(R);
  EXPECT_LT(rotation_vector(*R).norm(), 1e-6);
}

TEST(ImuTrack, KnowsNothingBeyondItsSamplesOrAcrossGaps) {
  ImuTrack track = turning_track([](double) { return 1.0; });
  const Eigen::Vector3d no_bias = Eigen::Vector3d::Zero();
  EXPECT_FALSE(track.rotation(-1, 100 * ms, no_bias));
  EXPECT_FALSE(track.rotation(900 * ms, 1001 * ms, no_bias));
  EXPECT_TRUE(track.rotation(900 * ms, 1000 * ms, no_bias));
  for (int k = 0; k < 100; ++k)
    ASSERT_EQ(track.add(turning_sample((1100 + 5 * k) * ms, 1.0)), ImuSampleFate::taken);
  EXPECT_FALSE(track.rotation(990 * ms, 1110 * ms, no_bias));
  EXPECT_FALSE(track.rate_at(1050 * ms));
  EXPECT_TRUE(track.rotation(1100 * ms, 1110 * ms, no_bias));
  EXPECT_FALSE(ImuTrack().rotation(0, 1, no_bias));
}

TEST(ImuTrack, DoesNotBelieveAFrozenSensor) {
  ImuTrack track = turning_track([](double) { return 1.0; });
  ImuSample frozen = turning_sample(1000 * ms, 1.0);
  for (int k = 1; k <= 100; ++k) {
    frozen.stamp_ns += 5 * ms;
    ASSERT_EQ(track.add(frozen), ImuSampleFate::taken);
  }
  EXPECT_FALSE(track.rotation(1300 * ms, 1400 * ms, Eigen::Vector3d::Zero()));
  EXPECT_TRUE(track.rotation(900 * ms, 1000 * ms, Eigen::Vector3d::Zero()));
}

/// A gyro with noise that turns at `rate_z(t)` about z, what is measured bent by `spoil(k, rate)`.
template <typename Rate, typename Spoil>
ImuTrack noisy_track(Rate rate_z, Spoil spoil) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.003);
  ImuTrack track;
  for (int k = 0; k <= 400; ++k) {
    Eigen::Vector3d rate(noise(random), noise(random), rate_z(0.005 * k) + noise(random));
    spoil(k, rate);
    EXPECT_EQ(track.add({k * 5 * ms, rate, {0.0, noise(random), 9.81}}), ImuSampleFate::taken);
  }
  return track;
}

double swing(double t) { return 2.5 * std::sin(3.0 * t); }
/// Its integral.
double swung(double from_s, double to_s) {
  return 2.5 / 3.0 * (std::cos(3.0 * from_s) - std::cos(3.0 * to_s));
}

TEST(ImuTrack, DoesNotTurnByGlitches) {
  for (const int length : {1, 3}) {
    const ImuTrack track = noisy_track(swing, [&](int k, Eigen::Vector3d& rate) {
      if (k % 40 >= 10 && k % 40 < 10 + length) rate(k / 40 % 3) += k % 80 < 40 ? 30.0 : -8.0;
    });
    for (int from_ms = 0; from_ms < 2000; from_ms += 100)
      EXPECT_NEAR(yaw_between(track, from_ms * ms, (from_ms + 100) * ms),
                  swung(0.001 * from_ms, 0.001 * from_ms + 0.1), 0.003)
          << length << " samples, " << from_ms << " ms";
  }
}

TEST(ImuTrack, TurnsByShocksThatLastAndByTurnsThatSetIn) {
  // 60 ms of a wheel over a kerb, and a turn that sets in within a sample.
  const auto rate = [](double t) {
    return (t > 0.5 && t < 0.56 ? 6.0 : 0.0) + (t > 1.2 ? 3.0 : 0.0);
  };
  const ImuTrack track = noisy_track(rate, [](int, Eigen::Vector3d&) {});
  EXPECT_NEAR(yaw_between(track, 400 * ms, 700 * ms), 0.36, 0.04);
  EXPECT_NEAR(yaw_between(track, 1100 * ms, 1400 * ms), 0.6, 0.02);
}

TEST(ImuTrack, SaysNothingWhereTheGyroIsAtTheEndOfItsRangeOrStuck) {
  const auto no_bias = Eigen::Vector3d::Zero();
  const ImuTrack saturated = noisy_track(
      swing, [](int, Eigen::Vector3d& rate) { rate = rate.cwiseMax(-2.0).cwiseMin(2.0); });
  EXPECT_TRUE(saturated.rotation(0, 200 * ms, no_bias));
  EXPECT_FALSE(saturated.rotation(450 * ms, 550 * ms, no_bias));
  EXPECT_TRUE(saturated.rotation(800 * ms, 1200 * ms, no_bias));
  // Its accelerations go on.
  Eigen::Vector3d held = no_bias;
  const ImuTrack stuck = noisy_track(swing, [&](int k, Eigen::Vector3d& rate) {
    (k < 200 ? held : rate) = k < 200 ? rate : held;
  });
  EXPECT_TRUE(stuck.rotation(800 * ms, 900 * ms, no_bias));
  EXPECT_FALSE(stuck.rotation(1100 * ms, 1200 * ms, no_bias));
}

/// Scans of 0.1 s, of 5 s, of which the track tells how far they turned.
int told_scans(const ImuTrack& track) {
  int told = 0;
  for (int k = 0; k < 50; ++k)
    told += track.rotation(k * 100 * ms, (k + 1) * 100 * ms, Eigen::Vector3d::Zero()) ? 1 : 0;
  return told;
}

/// A turn that sets in and ends within 0.3 s, and stays at `top` for 2 s.
double turn(double t, double top) {
  return top * std::clamp(std::min((t - 1.0) / 0.3, (3.6 - t) / 0.3), 0.0, 1.0);
}

TEST(ImuTrack, TellsTurnsOfASimulatedGyroWithoutNoise) {
  for (const double top : {0.5, 1.2}) {
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0.0, 0.01);
    ImuTrack track;
    for (int k = 0; k <= 500; ++k)
      (void)track.add({k * 10 * ms, {0.0, 0.0, turn(0.01 * k, top)}, {0.0, noise(random), 9.81}});
    EXPECT_EQ(told_scans(track), 50) << top;
    EXPECT_NEAR(yaw_between(track, 0, 5000 * ms), 2.3 * top, 0.01);
  }
}

TEST(ImuTrack, TellsThatAGyroRestsWhichSaysZeroThen) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.003);
  ImuTrack track;
  for (int k = 0; k <= 500; ++k) {
    Eigen::Vector3d rate(noise(random), noise(random), turn(0.01 * k, 0.5));
    if (rate.z() == 0.0) rate.setZero();
    (void)track.add({k * 10 * ms, rate, {0.0, noise(random), 9.81}});
  }
  EXPECT_EQ(told_scans(track), 50);
}

TEST(ImuTrack, TurnsByAJolt) {
  // By 20 ms of a wheel on a stone, 188 rad/s2 at its steepest.
  for (const double late : {0.0, 0.25, 0.5}) {
    const ImuTrack track = noisy_track(
        [&](double t) {
          const double phase = (t - 0.5) / 0.02 - 0.25 * late;
          return phase > 0.0 && phase < 1.0 ? 1.2 * std::sin(M_PI * phase) : 0.0;
        },
        [](int, Eigen::Vector3d&) {});
    EXPECT_NEAR(yaw_between(track, 400 * ms, 600 * ms), 0.0153, 0.002) << late;
  }
}

TEST(ImuTrack, LeavesOutWhatIsNoMeasurement) {
  ImuTrack track;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(track.add({0, {nan, 0.0, 0.0}, {0.0, 0.0, 9.8}}), ImuSampleFate::not_usable);
  EXPECT_EQ(track.add({0, {0.0, 0.0, 0.0}, {0.0, nan, 9.8}}), ImuSampleFate::not_usable);
  EXPECT_EQ(track.add({0, {1e4, 0.0, 0.0}, {0.0, 0.0, 9.8}}), ImuSampleFate::not_usable);
  EXPECT_EQ(track.add(turning_sample(5 * ms, 0.0)), ImuSampleFate::taken);
  EXPECT_EQ(track.add(turning_sample(5 * ms, 0.0)), ImuSampleFate::out_of_order);
  EXPECT_EQ(track.add(turning_sample(4 * ms, 0.0)), ImuSampleFate::out_of_order);
}

TEST(ImuTrack, GoesOnAfterItsClockWasSetBack) {
  ImuTrack track;
  ASSERT_EQ(track.add(turning_sample(3'600'000 * ms, 1.0)), ImuSampleFate::taken);
  for (int k = 0; k < 300; ++k) (void)track.add(turning_sample(k * 5 * ms, 1.0));
  EXPECT_NEAR(yaw_between(track, 1000 * ms, 1400 * ms), 0.4, 1e-6);
}

TEST(ImuTrack, TellsUpOnlyWhereItMovesSteadily) {
  ImuTrack track;
  const Eigen::Vector3d up = Eigen::Vector3d(0.3, -0.2, 0.9).normalized();
  for (int k = 0; k < 200; ++k) {
    const double shaken = k < 100 ? 0.0 : (k % 2 == 0 ? 3.0 : -3.0);
    const Eigen::Vector3d noise(0.01 * (k % 3), shaken, 0.01 * (k % 5));
    ASSERT_EQ(track.add({k * 5 * ms, {0.001 * (k % 2), 0.0, 0.004}, 9.81 * up + noise}),
              ImuSampleFate::taken);
  }
  const auto steady = track.steady_mean(0, 490 * ms);
  ASSERT_TRUE(steady);
  EXPECT_LT(std::acos(steady->up_imu.dot(up)), 0.005);
  EXPECT_NEAR(steady->angular_velocity_imu.z(), 0.004, 1e-9);
  EXPECT_FALSE(steady->is_frozen);
  EXPECT_FALSE(track.steady_mean(500 * ms, 990 * ms));
  EXPECT_FALSE(track.steady_mean(0, 15 * ms));
}

TEST(ImuTrack, TellsAFrozenSensor) {
  for (const int step_ms : {5, 40}) {
    ImuTrack track;
    for (int k = 0; k <= 500 / step_ms; ++k) {
      const auto sample = ImuSample{k * step_ms * ms, {0.01, 0.0, 0.0}, {0.1, 0.0, 9.7}};
      ASSERT_EQ(track.add(sample), ImuSampleFate::taken);
    }
    const auto mean = track.steady_mean(0, 500 * ms);
    ASSERT_TRUE(mean) << step_ms;
    EXPECT_TRUE(mean->is_frozen) << step_ms;
  }
}

}  // namespace
}  // namespace stillmap
