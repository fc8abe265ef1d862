#include "core/inertial/inertial_tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace stillmap {
namespace {

constexpr std::int64_t per_ms = 1'000'000;

/// A lidar that swings about a leaning axis, after a second of rest.
Eigen::Quaterniond R_map_lidar_at(double time_s) {
  const double t = std::max(0.0, time_s - 1.0);
  const double angle = 0.6 * (1.0 - std::cos(2.0 * t));
  return rotation_by(angle * Eigen::Vector3d(0.1, 0.3, 0.9).normalized());
}

struct Imu {
  ImuMount mount;
  Eigen::Vector3d bias_imu = Eigen::Vector3d::Zero();
  double unit = 1.0;
};

ImuSample sample_at(const Imu& imu, int k, std::mt19937& random) {
  constexpr double half_step_s = 0.0025;
  std::normal_distribution<double> noise(0.0, 0.002);
  const double time_s = 0.005 * k;
  const Eigen::Matrix3d R_imu_lidar = imu.mount.R_lidar_imu.transpose();
  const Eigen::Vector3d turned = rotation_vector(R_map_lidar_at(time_s - half_step_s).conjugate() *
                                                 R_map_lidar_at(time_s + half_step_s));
  const Eigen::Vector3d random_rate(noise(random), noise(random), noise(random));
  ImuSample sample;
  sample.stamp_ns = std::llround(1e9 * (time_s + imu.mount.time_offset_s));
  sample.angular_velocity_imu =
      imu.unit * (R_imu_lidar * turned / 0.005 + imu.bias_imu + random_rate);
  sample.acceleration_imu =
      9.81 * (R_imu_lidar * (R_map_lidar_at(time_s).conjugate() * Eigen::Vector3d::UnitZ()));
  return sample;
}

/// Scans at 10 Hz that are registered exactly; each comes after the samples of its sweep.
void drive(InertialTracker& tracker, const Imu& imu, double seconds) {
  std::mt19937 random(7);
  int k = 0;
  for (int scan = 1; scan < static_cast<int>(10.0 * seconds); ++scan) {
    for (; 0.005 * k < 0.1 * scan + 0.1; ++k) tracker.add(sample_at(imu, k, random));
    const std::int64_t now_ns = scan * 100 * per_ms;
    tracker.learn(now_ns - 100 * per_ms, now_ns,
                  (R_map_lidar_at(0.1 * scan - 0.1).conjugate() * R_map_lidar_at(0.1 * scan))
                      .toRotationMatrix());
  }
}

constexpr SweepTimes sweep{.middle_s = 0.05, .duration_s = 0.1};

double angle_between(const Eigen::Matrix3d& a, const Eigen::Quaterniond& b) {
  return Eigen::Quaterniond(a).angularDistance(b);
}

TEST(InertialTracker, TellsTheRotationOfSweepsWithBiasDelayAndMountOfItsOwn) {
  const Eigen::Quaterniond R_lidar_imu = rotation_by({0.4, -1.0, 2.0});
  const Imu imu{.mount = {R_lidar_imu.toRotationMatrix(), 0.008}, .bias_imu = {0.01, -0.01, 0.005}};
  // The delay is to be found.
  InertialTracker tracker(ImuMount{R_lidar_imu.toRotationMatrix(), 0.0});
  drive(tracker, imu, 10.0);
  ASSERT_TRUE(tracker.is_believed());
  EXPECT_NEAR(tracker.calibration().time_offset_s(), 0.008, 0.001);
  EXPECT_LT((tracker.calibration().bias_imu() - imu.bias_imu).norm(), 0.002);
  const auto motion = tracker.motion(9750 * per_ms, 9800 * per_ms, sweep);
  ASSERT_TRUE(motion);
  const Eigen::Quaterniond R_map_middle = R_map_lidar_at(9.85);
  EXPECT_LT(angle_between(motion->R_last_middle, R_map_lidar_at(9.75).conjugate() * R_map_middle),
            0.0015);
  ASSERT_GT(motion->R_middle_at.size(), 10U);
  EXPECT_LT(
      angle_between(motion->R_middle_at.front(), R_map_middle.conjugate() * R_map_lidar_at(9.8)),
      0.0015);
  EXPECT_LT(
      angle_between(motion->R_middle_at.back(), R_map_middle.conjugate() * R_map_lidar_at(9.9)),
      0.0015);
  EXPECT_EQ(tracker.counts().scans_helped, 1U);
}

TEST(InertialTracker, IsNotBelievedWithWrongUnitsOrAxes) {
  InertialTracker in_degrees(ImuMount{});
  drive(in_degrees, {.mount = {}, .bias_imu = Eigen::Vector3d::Zero(), .unit = 57.2958}, 10.0);
  EXPECT_FALSE(in_degrees.is_believed());
  EXPECT_FALSE(in_degrees.motion(9750 * per_ms, 9800 * per_ms, sweep));
  InertialTracker turned(ImuMount{});
  drive(turned, {.mount = {rotation_by({1.5, 0.0, 0.0}).toRotationMatrix(), 0.0}}, 10.0);
  EXPECT_FALSE(turned.is_believed());
  EXPECT_LT(turned.calibration().bias_imu().norm(), 0.05);
}

TEST(InertialTracker, IsNoLongerBelievedByPosesInDoubtEither) {
  InertialTracker tracker(ImuMount{});
  drive(tracker, {}, 10.0);
  ASSERT_TRUE(tracker.is_believed());
  const Eigen::Vector3d bias_imu = tracker.calibration().bias_imu();
  std::mt19937 random(7);
  for (int k = 2010; k < 2100; ++k) tracker.add(sample_at({}, k, random));
  // The lidar turned about another axis than the gyro says.
  for (int scan = 101; scan < 105; ++scan)
    tracker.judge((scan - 1) * 100 * per_ms, scan * 100 * per_ms,
                  rotation_by({scan % 2 == 0 ? 0.1 : 0.05, 0.0, 0.0}).toRotationMatrix());
  EXPECT_FALSE(tracker.is_believed());
  EXPECT_EQ(tracker.calibration().bias_imu(), bias_imu);
}

TEST(InertialTracker, SaysNothingWhereSamplesAreMissing) {
  InertialTracker tracker(ImuMount{});
  drive(tracker, {}, 10.0);
  ASSERT_TRUE(tracker.is_believed());
  EXPECT_FALSE(tracker.motion(9750 * per_ms, 12'000 * per_ms, sweep));
  EXPECT_EQ(tracker.counts().scans_without_samples, 1U);
}

TEST(InertialTracker, LearnsTheBiasAtRestWhateverTheRateOfTheLidar) {
  const Eigen::Vector3d bias_imu(0.02, -0.01, 0.005);
  for (const std::int64_t period_ms : {100, 50, 25}) {
    InertialTracker tracker(ImuMount{});
    std::mt19937 random(11);
    std::normal_distribution<double> noise(0.0, 0.001);
    std::int64_t sampled_ms = 0;
    for (std::int64_t now_ms = period_ms; now_ms <= 2000; now_ms += period_ms) {
      for (; sampled_ms <= now_ms + 50; sampled_ms += 5) {
        ImuSample sample;
        sample.stamp_ns = sampled_ms * per_ms;
        sample.angular_velocity_imu = bias_imu + Eigen::Vector3d::Constant(noise(random));
        sample.acceleration_imu = {0.0, 0.0, 9.81 + noise(random)};
        tracker.add(sample);
      }
      tracker.learn((now_ms - period_ms) * per_ms, now_ms * per_ms, Eigen::Matrix3d::Identity());
    }
    EXPECT_LT((tracker.calibration().bias_imu() - bias_imu).norm(), 5e-4) << period_ms;
  }
}

TEST(InertialTracker, TellsUpAtRestAlongTheLidarsAxes) {
  const Eigen::Quaterniond R_lidar_imu = rotation_by({0.4, -1.0, 2.0});
  const Imu imu{.mount = {R_lidar_imu.toRotationMatrix(), 0.0}};
  InertialTracker tracker(imu.mount);
  std::mt19937 random(3);
  for (int k = 0; k < 200; ++k) tracker.add(sample_at(imu, k, random));
  const UpDirection up = tracker.up_lidar(900 * per_ms);
  const auto& up_lidar = up.up_lidar;
  ASSERT_TRUE(up_lidar) << up.fault;
  EXPECT_LT((*up_lidar - Eigen::Vector3d::UnitZ()).norm(), 0.001);
  for (int k = 200; k < 500; ++k) tracker.add(sample_at(imu, k, random));
  EXPECT_FALSE(tracker.up_lidar(2000 * per_ms).up_lidar) << "it swings";
  InertialTracker unknown_mount(std::nullopt);
  for (int k = 0; k < 200; ++k) unknown_mount.add(sample_at(imu, k, random));
  EXPECT_FALSE(unknown_mount.up_lidar(900 * per_ms).up_lidar);
}

TEST(InertialTracker, TakesASlowTurnForNoBias) {
  // A curve that turns by less from scan to scan than registration can tell from rest.
  constexpr double turn_rad_s = 0.012;
  InertialTracker tracker(ImuMount{});
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.001);
  std::int64_t sampled_ms = 0;
  double worst_rad_s = 0.0;
  for (std::int64_t now_ms = 100; now_ms <= 10'000; now_ms += 100) {
    for (; sampled_ms <= now_ms + 50; sampled_ms += 5) {
      tracker.add({sampled_ms * per_ms,
                   {noise(random), noise(random), turn_rad_s + noise(random)},
                   {noise(random), noise(random), 9.81}});
    }
    tracker.learn((now_ms - 100) * per_ms, now_ms * per_ms,
                  rotation_by({0.0, 0.0, 0.1 * turn_rad_s}).toRotationMatrix());
    worst_rad_s = std::max(worst_rad_s, tracker.calibration().bias_imu().norm());
  }
  EXPECT_LT(worst_rad_s, 0.002);
}

/// What an IMU at rest tells of up at 1 s, from samples of these times [ms].
UpDirection up_from(std::int64_t first_ms, std::int64_t last_ms, std::int64_t step_ms,
                    const Eigen::Vector3d& acceleration) {
  InertialTracker tracker(ImuMount{});
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 0.002);
  for (std::int64_t now_ms = first_ms; now_ms <= last_ms; now_ms += step_ms)
    tracker.add({now_ms * per_ms, {noise(random), noise(random), noise(random)}, acceleration});
  return tracker.up_lidar(1000 * per_ms);
}

TEST(InertialTracker, TellsUpWhateverTheRateOfTheImuFromATimeThatIsLongEnough) {
  const Eigen::Vector3d gravity(0.0, 0.0, 9.81);
  for (const std::int64_t step_ms : {1, 5, 20, 40}) {
    EXPECT_TRUE(up_from(520, 1000, step_ms, gravity).up_lidar) << step_ms;
    EXPECT_TRUE(up_from(800, 1000, step_ms, gravity).up_lidar) << step_ms;
    EXPECT_FALSE(up_from(960, 1000, step_ms, gravity).up_lidar) << step_ms;
    // A recording that begins with its first scan.
    EXPECT_TRUE(up_from(900, 1200, step_ms, gravity).up_lidar) << step_ms;
  }
  const UpDirection braking = up_from(990, 1000, 1, {-3.0, 0.0, 9.81});
  EXPECT_FALSE(braking.up_lidar);
  EXPECT_FALSE(braking.fault.empty());
}

TEST(InertialTracker, TakesOnlyGravityForUp) {
  EXPECT_TRUE(up_from(500, 1000, 5, {0.0, 0.0, 9.6}).up_lidar);
  EXPECT_TRUE(up_from(500, 1000, 5, {0.0, 0.0, 1.0}).up_lidar) << "in g";
  EXPECT_FALSE(up_from(500, 1000, 5, {0.3, 0.1, 0.0}).up_lidar) << "gravity was taken out";
  EXPECT_FALSE(up_from(500, 1000, 5, {8.0, 0.0, 9.81}).up_lidar);
}

TEST(InertialTracker, CountsScansWhoseSamplesAreNotBelievedOrMissing) {
  InertialTracker in_degrees(ImuMount{});
  EXPECT_FALSE(in_degrees.motion(0, 100 * per_ms, sweep));
  EXPECT_EQ(in_degrees.counts().scans_without_samples, 0U) << "there is no IMU";
  drive(in_degrees, {.mount = {}, .bias_imu = Eigen::Vector3d::Zero(), .unit = 57.2958}, 10.0);
  EXPECT_FALSE(in_degrees.motion(9750 * per_ms, 9800 * per_ms, sweep));
  EXPECT_EQ(in_degrees.counts().scans_not_believed, 1U);
  EXPECT_GT(in_degrees.unbelieved_turn_rad(), 1.0);

  InertialTracker other_clock(ImuMount{});
  drive(other_clock, {.mount = {Eigen::Matrix3d::Identity(), -37.0}}, 10.0);
  EXPECT_FALSE(other_clock.motion(9750 * per_ms, 9800 * per_ms, sweep));
  EXPECT_EQ(other_clock.counts().scans_without_samples, 1U);
  ASSERT_TRUE(other_clock.samples_behind_s());
  EXPECT_NEAR(*other_clock.samples_behind_s(), 37.0, 0.2);

  InertialTracker good(ImuMount{});
  drive(good, {}, 10.0);
  EXPECT_EQ(good.unbelieved_turn_rad(), 0.0);
}

}  // namespace
}  // namespace stillmap
