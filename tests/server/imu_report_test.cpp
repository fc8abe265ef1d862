#include "server/mapping/imu_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace stillmap::server {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr std::int64_t per_ms = 1'000'000;
constexpr SweepTimes sweep{.middle_s = 0.05, .duration_s = 0.1};

std::string logged_by(const std::function<void()>& what) {
  testing::internal::CaptureStdout();
  what();
  return testing::internal::GetCapturedStdout();
}

/// A lidar that turns by 0.3 rad/s, and an IMU in other units, or of a clock that is `late_ms`
/// late.
void turn(InertialTracker& tracker, ImuReport& report, double unit, std::int64_t late_ms,
          std::int64_t scans) {
  const Eigen::Matrix3d step = rotation_by({0.0, 0.0, 0.03}).toRotationMatrix();
  std::int64_t sampled_ms = 0;
  for (std::int64_t scan = 1; scan < scans; ++scan) {
    const std::int64_t now_ns = scan * 100 * per_ms;
    for (; sampled_ms < 100 * scan + 200; sampled_ms += 5) {
      const double noise = 1e-4 * static_cast<double>(sampled_ms % 3);
      tracker.add(
          {(sampled_ms - late_ms) * per_ms, {noise, noise, 0.3 * unit + noise}, {0.0, 0.0, 9.81}});
    }
    (void)tracker.motion(now_ns - 100 * per_ms, now_ns, sweep);
    tracker.learn(now_ns - 100 * per_ms, now_ns, step);
    report.update(tracker);
  }
}

TEST(ImuReport, WarnsOfRatesThatAreNeverTheLidars) {
  Statistics statistics;
  ImuReport report(statistics);
  InertialTracker tracker(ImuMount{});
  EXPECT_THAT(logged_by([&] { turn(tracker, report, 57.2958, 0, 15); }), IsEmpty());
  EXPECT_THAT(logged_by([&] { turn(tracker, report, 57.2958, 0, 100); }),
              HasSubstr("rates are in rad/s"));
  dds::ServerStatus status;
  statistics.report_to(status);
  EXPECT_GT(status.counter("imu_not_yet_believed"), 50U);
  EXPECT_EQ(status.counter("imu_scans_helped"), 0U);
}

TEST(ImuReport, WarnsOfAClockThatIsNotTheLidars) {
  Statistics statistics;
  ImuReport report(statistics);
  InertialTracker tracker(ImuMount{});
  EXPECT_THAT(logged_by([&] { turn(tracker, report, 1.0, 37'000, 100); }),
              HasSubstr("the newest IMU stamp is 36.9 s before the scan's"));
  dds::ServerStatus status;
  statistics.report_to(status);
  EXPECT_EQ(status.counter("imu_samples_missing"), 99U);
}

TEST(ImuReport, DoesNotWarnOfAnImuThatHelps) {
  Statistics statistics;
  ImuReport report(statistics);
  InertialTracker tracker(ImuMount{});
  EXPECT_THAT(logged_by([&] { turn(tracker, report, 1.0, 0, 300); }), Not(HasSubstr("warn")));
}

TEST(ImuReport, TellsOnceAMapHowItWasLevelled) {
  Statistics statistics;
  ImuReport report(statistics);
  const Levelling level{.tilt_rad = 0.1};
  EXPECT_THAT(logged_by([&] { report.tell(std::nullopt); }), IsEmpty());
  EXPECT_THAT(logged_by([&] { report.tell(level); }), HasSubstr("the lidar leans by 5.7 degrees"));
  EXPECT_THAT(logged_by([&] { report.tell(level); }), IsEmpty());
  EXPECT_THAT(logged_by([&] { report.tell(Levelling{.fault = "it was shaken", .map = 1}); }),
              HasSubstr("not levelled by it: it was shaken"));
}

}  // namespace
}  // namespace stillmap::server
