#include "core/lidar/sensor_model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace stillmap {
namespace {

using testing::AllOf;
using testing::HasSubstr;

double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

TEST(SensorModel, ShippedModelsHaveNoFaults) {
  for (const SensorModel& sensor : {hdl_64e(), hdl_32e(), vlp_16()}) {
    EXPECT_EQ(sensor.faults(), "") << sensor.name;
  }
}

TEST(SensorModel, ShippedBeamsAreTheMakersBeams) {
  EXPECT_NEAR(degrees(hdl_64e().beam_elevation(0)), 2.0, 1e-9);
  EXPECT_NEAR(degrees(hdl_64e().beam_elevation(31)), -8.333, 1e-3);
  EXPECT_NEAR(degrees(hdl_64e().beam_elevation(32)), -8.83, 1e-9);
  EXPECT_NEAR(degrees(hdl_64e().beam_elevation(63)), -24.33, 1e-9);
  EXPECT_NEAR(degrees(hdl_32e().beam_elevation(0)), 10.667, 1e-3);
  EXPECT_NEAR(degrees(hdl_32e().beam_elevation(31)), -30.667, 1e-3);
  for (int ring = 0; ring < 16; ++ring) {
    EXPECT_NEAR(degrees(vlp_16().beam_elevation(ring)), 15.0 - 2.0 * ring, 1e-9);
  }
}

TEST(SensorModel, FaultsNameTheFieldAndItsValue) {
  const auto faults_after = [](auto change) {
    SensorModel sensor = vlp_16();
    change(sensor);
    return sensor.faults();
  };
  EXPECT_THAT(faults_after([](auto& s) { s.rings = 0; }), HasSubstr("rings = 0"));
  EXPECT_THAT(faults_after([](auto& s) { s.columns = -5; }), HasSubstr("columns = -5"));
  EXPECT_THAT(faults_after([](auto& s) { s.fov_up = 3.0; }), HasSubstr("fov_up = 171.8"));
  EXPECT_THAT(faults_after([](auto& s) { s.fov_down = std::nan(""); }),
              HasSubstr("fov_down = nan"));
  EXPECT_THAT(faults_after([](auto& s) { s.fov_down = s.fov_up; }),
              AllOf(HasSubstr("fov_down = 16"), HasSubstr("fov_up = 16")));
  EXPECT_THAT(faults_after([](auto& s) { s.min_range_m = -1.0; }), HasSubstr("min_range_m = -1"));
  EXPECT_THAT(faults_after([](auto& s) { s.max_range_m = 0.25; }), HasSubstr("max_range_m = 0.25"));
  EXPECT_THAT(faults_after([](auto& s) { s.period_s = 0.0; }), HasSubstr("period_s = 0"));
  EXPECT_THAT(
      faults_after([](auto& s) { s.intensity_scale = std::numeric_limits<float>::infinity(); }),
      HasSubstr("intensity_scale = inf"));
}

TEST(SensorModel, FaultsOfBeamsNameTheBeam) {
  SensorModel sensor = vlp_16();
  sensor.beam_elevations = {0.1, 0.0};
  EXPECT_THAT(sensor.faults(), HasSubstr("2 entries for rings = 16"));
  sensor.rings = 2;
  EXPECT_EQ(sensor.faults(), "");
  sensor.beam_elevations = {0.0, 0.1};
  EXPECT_THAT(sensor.faults(), HasSubstr("beam_elevations[1]"));
  sensor.beam_elevations = {1.5, 0.1};
  EXPECT_THAT(sensor.faults(), HasSubstr("beam_elevations[0]"));
}

TEST(SensorModel, EveryFaultHasItsOwnLine) {
  SensorModel sensor = vlp_16();
  sensor.rings = 0;
  sensor.columns = 0;
  sensor.period_s = -1.0;
  const std::string faults = sensor.faults();
  EXPECT_EQ(std::count(faults.begin(), faults.end(), '\n'), 3);
}

}  // namespace
}  // namespace stillmap
