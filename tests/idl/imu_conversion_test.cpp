#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "idl/conversions/imu.hpp"

namespace stillmap::wire {
namespace {

const ImuSample sample{1'700'000'000'123'456'789, {0.1, -0.2, 0.3}, {0.5, -9.5, 1.5}};

TEST(ImuConversion, ComesBackAsItWent) {
  const auto imu = to_imu(sample, "imu_link");
  EXPECT_EQ(imu.header().frame_id(), "imu_link");
  EXPECT_EQ(imu.orientation_covariance()[0], -1.0) << "ROS 2's word for no orientation";
  const auto back = from_imu(imu);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->stamp_ns, sample.stamp_ns);
  EXPECT_EQ(back->angular_velocity_imu, sample.angular_velocity_imu);
  EXPECT_EQ(back->acceleration_imu, sample.acceleration_imu);
}

TEST(ImuConversion, WantsAStampAndLetsTheMapperJudgeTheRest) {
  auto imu = to_imu(sample, "imu");
  imu.angular_velocity().x(std::numeric_limits<double>::quiet_NaN());
  const auto back = from_imu(imu);
  ASSERT_TRUE(back);
  EXPECT_TRUE(std::isnan(back->angular_velocity_imu.x()));
  imu.header().stamp().nanosec(2'000'000'000);
  EXPECT_FALSE(from_imu(imu));
}

}  // namespace
}  // namespace stillmap::wire
