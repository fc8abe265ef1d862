#include "config/loaders/sensor_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/config/config_files.hpp"

namespace stillmap {
namespace {

using test::refusal;
using test::shipped;
using test::write_file;
using ::testing::HasSubstr;

void expect_same(const SensorModel& a, const SensorModel& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.pattern, b.pattern);
  EXPECT_EQ(a.rings, b.rings);
  EXPECT_NEAR(a.fov_up, b.fov_up, 1e-12);
  EXPECT_NEAR(a.fov_down, b.fov_down, 1e-12);
  EXPECT_THAT(a.beam_elevations,
              ::testing::Pointwise(::testing::DoubleNear(1e-12), b.beam_elevations));
  EXPECT_NEAR(a.elevation_offset, b.elevation_offset, 1e-9);
  EXPECT_EQ(a.columns, b.columns);
  EXPECT_EQ(a.min_range_m, b.min_range_m);
  EXPECT_EQ(a.max_range_m, b.max_range_m);
  EXPECT_EQ(a.period_s, b.period_s);
  EXPECT_EQ(a.ring_source, b.ring_source);
  EXPECT_EQ(a.intensity_scale, b.intensity_scale);
  EXPECT_EQ(a.motion_limits.max_speed_m_s, b.motion_limits.max_speed_m_s);
  EXPECT_EQ(a.motion_limits.max_acceleration_m_s2, b.motion_limits.max_acceleration_m_s2);
  EXPECT_NEAR(a.motion_limits.max_turn_rate_rad_s, b.motion_limits.max_turn_rate_rad_s, 1e-9);
  ASSERT_EQ(a.imu.has_value(), b.imu.has_value());
  if (!a.imu) return;
  EXPECT_TRUE(a.imu->R_lidar_imu.isApprox(b.imu->R_lidar_imu, 1e-5));
  EXPECT_EQ(a.imu->time_offset_s, b.imu->time_offset_s);
}

TEST(SensorFile, ShippedFilesEqualTheBuiltInSensors) {
  for (const std::string name : {"hdl_64e", "hdl_32e", "vlp_16"}) {
    SCOPED_TRACE(name);
    expect_same(load_sensor(shipped("sensors/" + name + ".yaml").string()), load_sensor(name));
  }
}

TEST(SensorFile, ShippedExampleCanBeUsed) {
  const SensorModel sensor = load_sensor(shipped("sensors/generic_example.yaml").string());
  EXPECT_EQ(sensor.rings, 128);
  EXPECT_EQ(sensor.faults(), "");
}

TEST(SensorFile, ShippedLivoxFilesHaveNoRings) {
  for (const std::string name : {"livox_avia", "livox_mid_360"}) {
    SCOPED_TRACE(name);
    const SensorModel sensor = load_sensor(shipped("sensors/" + name + ".yaml").string());
    EXPECT_EQ(sensor.pattern, ScanPattern::irregular);
    EXPECT_EQ(sensor.faults(), "");
  }
}

TEST(SensorFile, WhatIsSavedIsReadBack) {
  SensorModel sensor = hdl_64e();
  sensor.name = "a name: with {yaml} in it";
  sensor.max_range_m = 77.25;
  sensor.elevation_offset = 0.0036;
  sensor.ring_source = RingSource::field;
  sensor.intensity_scale = 1.0F / 255.0F;
  sensor.imu = ImuMount{
      .R_lidar_imu =
          Eigen::AngleAxisd(2.0, Eigen::Vector3d(1.0, -2.0, 0.5).normalized()).toRotationMatrix(),
      .time_offset_s = 0.004};
  sensor.motion_limits = {
      .max_speed_m_s = 2.5, .max_acceleration_m_s2 = 1.25, .max_turn_rate_rad_s = 0.75};
  const auto file = write_file("saved.yaml", "");
  save_sensor(sensor, file);
  expect_same(load_sensor(file.string()), sensor);
  sensor.pattern = ScanPattern::irregular;
  save_sensor(sensor, file);
  expect_same(load_sensor(file.string()), sensor);
  save_sensor(vlp_16(), file);
  expect_same(load_sensor(file.string()), vlp_16());
}

TEST(SensorFile, CannotBeSavedWhereNoFileCanBe) {
  EXPECT_THROW(save_sensor(vlp_16(), "/dev/null/sensor.yaml"), std::runtime_error);
}

TEST(SensorFile, DemandsWhatHasNoDefault) {
  const std::string text =
      refusal([] { (void)load_sensor(write_file("a.yaml", "name: x").string()); });
  for (const char* field : {"rings", "fov_up_deg", "fov_down_deg"}) {
    EXPECT_THAT(text, HasSubstr(field + std::string(": is missing")));
  }
}

TEST(SensorFile, KnowsTheImuOnlyWhereItsAxesAreGiven) {
  const std::string sensor = "name: x\nrings: 16\nfov_up_deg: 15\nfov_down_deg: -15\n";
  EXPECT_FALSE(load_sensor(write_file("a.yaml", sensor).string()).imu);
  const auto imu =
      load_sensor(write_file("a.yaml", sensor + "imu: {roll_pitch_yaw_deg: [0, 0, 90]}").string())
          .imu;
  ASSERT_TRUE(imu);
  EXPECT_TRUE((imu->R_lidar_imu * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY()));
  for (const char* fault :
       {"roll_pitch_yaw_deg: [0, 0]", "time_offset_s: 0.01", "time_offset_s: 3"}) {
    const auto file = write_file("a.yaml", sensor + "imu: {" + fault + "}");
    EXPECT_THAT(refusal([&] { (void)load_sensor(file.string()); }), HasSubstr("imu."));
  }
}

TEST(SensorFile, WantsOneElevationForEachRing) {
  const auto file = write_file("a.yaml",
                               "{name: x, rings: 3, fov_up_deg: 5, fov_down_deg: -5, "
                               "beam_elevations_deg: [1, 0]}");
  EXPECT_THAT(refusal([&] { (void)load_sensor(file.string()); }), HasSubstr("beam_elevations"));
}

TEST(SensorFile, NamesTheBuiltInSensorsWhenThereIsNoSuchOne) {
  EXPECT_THAT(refusal([] { (void)load_sensor("ouster"); }), HasSubstr("hdl_32e, hdl_64e, vlp_16"));
}

}  // namespace
}  // namespace stillmap
