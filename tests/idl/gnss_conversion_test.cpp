#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "idl/conversions/gnss.hpp"

namespace stillmap::wire {
namespace {

GnssFix some_fix() {
  GnssFix fix{.stamp_ns = 1'700'000'000'123'456'789,
              .latitude_deg = 49.1,
              .longitude_deg = -8.2,
              .altitude_m = 115.5};
  fix.covariance_enu << 4.0, 0.5, 0.0, 0.5, 3.0, 0.1, 0.0, 0.1, 9.0;
  return fix;
}

TEST(GnssConversion, ComesBackAsItWent) {
  const auto message = to_nav_sat_fix(some_fix(), "antenna");
  EXPECT_EQ(message.header().frame_id(), "antenna");
  const ReceivedFix back = from_nav_sat_fix(message);
  ASSERT_TRUE(back.fix) << back.fault;
  EXPECT_EQ(back.fix->stamp_ns, some_fix().stamp_ns);
  EXPECT_EQ(back.fix->latitude_deg, 49.1);
  EXPECT_EQ(back.fix->longitude_deg, -8.2);
  EXPECT_EQ(back.fix->altitude_m, 115.5);
  EXPECT_EQ(back.fix->covariance_enu, some_fix().covariance_enu);
}

TEST(GnssConversion, AReceiverWithoutAFixIsNoFault) {
  auto message = to_nav_sat_fix(some_fix(), "antenna");
  message.status().status(0xFF);
  const ReceivedFix none = from_nav_sat_fix(message);
  EXPECT_FALSE(none.fix);
  EXPECT_EQ(none.fault, "");
}

TEST(GnssConversion, WhatCannotBeUsedIsSaid) {
  auto message = to_nav_sat_fix(some_fix(), "antenna");
  message.latitude(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(from_nav_sat_fix(message).fault, testing::HasSubstr("latitude"));
  message = to_nav_sat_fix(some_fix(), "antenna");
  message.header().stamp().nanosec(2'000'000'000);
  EXPECT_THAT(from_nav_sat_fix(message).fault, testing::HasSubstr("stamp"));
  message = to_nav_sat_fix(some_fix(), "antenna");
  message.position_covariance()[0] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(from_nav_sat_fix(message).fix);
  message.position_covariance_type(0);
  const ReceivedFix unknown = from_nav_sat_fix(message);
  ASSERT_TRUE(unknown.fix);
  EXPECT_EQ(unknown.fix->covariance_enu(0, 0), 9.0) << "of a receiver of single frequency";
  message.position_covariance({});
  message.position_covariance_type(2);
  EXPECT_EQ(from_nav_sat_fix(message).fix->covariance_enu(0, 0), 9.0) << "zeros say nothing";
}

}  // namespace
}  // namespace stillmap::wire
