#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

constexpr double step_s = 0.1;

/// A robot that looks to and fro while it drives through the hall.
double yaw_at(double time_s) { return 0.4 * std::sin(2.5 * time_s); }

StampedPose swinging_pose(int index) {
  StampedPose pose = room_pose(index);
  pose.T_map_lidar.linear() =
      Eigen::AngleAxisd(yaw_at(step_s * index), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return pose;
}

/// The samples of the tenth of a second before a scan, at 200 Hz.
std::vector<ImuSample> samples_before(int index) {
  std::vector<ImuSample> samples;
  for (int k = 1; k <= 20; ++k) {
    const double time_s = step_s * (index - 1) + 0.005 * k;
    ImuSample sample;
    sample.stamp_ns = room_pose(index - 1).stamp_ns + k * std::int64_t{5'000'000};
    sample.angular_velocity_imu = {1e-4 * (k % 3), 0.0, 1.0 * std::cos(2.5 * time_s)};
    sample.acceleration_imu = {0.0, 0.0, 9.81};
    samples.push_back(sample);
  }
  return samples;
}

TEST(ImuService, TheGyroHelpsAndWhatIsWrongWithItIsCounted) {
  const ServiceSetup setup("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisherOptions options = setup.publisher(true);
  options.imu_topic = "imu/data";
  ScanPublisher publisher(options);
  ASSERT_TRUE(publisher.wait_for_subscriber(patience));
  ASSERT_TRUE(publisher.wait_for_imu_subscriber(patience));

  constexpr int scans = 40;
  for (int index = 0; index < scans; ++index) {
    std::vector<ImuSample> samples = samples_before(index);
    if (index == 30) samples[3].angular_velocity_imu.x() = std::numeric_limits<double>::quiet_NaN();
    if (index == 31) samples[5].stamp_ns = samples[2].stamp_ns;
    EXPECT_EQ(publisher.publish(samples, patience), samples.size());
    ASSERT_TRUE(publisher.publish(seen_in_room(swinging_pose(index)), {}, patience));
  }
  dds::ServerStatus status;
  ASSERT_TRUE(eventually([&] {
    status = client.status();
    return status.counter("scans_mapped") == scans;
  }));
  EXPECT_EQ(status.health, OdometryHealth::good);
  EXPECT_EQ(status.counter("imu_samples"), 20U * scans);
  EXPECT_EQ(status.counter("imu_not_usable"), 1U);
  EXPECT_EQ(status.counter("imu_out_of_order"), 1U);
  EXPECT_EQ(status.counter("imu_disbelieved"), 0U);
  EXPECT_GT(status.counter("imu_scans_helped"), 10U);
}

}  // namespace
}  // namespace stillmap::test
