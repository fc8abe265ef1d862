#include "core/geodesy/gnss_fix.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace stillmap {
namespace {

using testing::HasSubstr;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(GnssFix, SaysWhichFieldIsAtFault) {
  const GnssFix sound{.latitude_deg = 49.0, .longitude_deg = 8.4, .altitude_m = 115.0};
  EXPECT_EQ(fault_of(sound), "");
  const auto fault = [&](auto change) {
    GnssFix fix = sound;
    change(fix);
    return fault_of(fix);
  };
  EXPECT_THAT(fault([](GnssFix& f) { f.latitude_deg = nan; }), HasSubstr("latitude is nan"));
  EXPECT_THAT(fault([](GnssFix& f) { f.latitude_deg = -90.0; }), HasSubstr("84 degrees"));
  EXPECT_THAT(fault([](GnssFix& f) { f.longitude_deg = 1e9; }), HasSubstr("longitude"));
  EXPECT_THAT(fault([](GnssFix& f) { f.altitude_m = 1e9; }), HasSubstr("altitude"));
  EXPECT_EQ(fault([](GnssFix& f) { f.altitude_m = nan; }), "") << "it may not be known";
  EXPECT_THAT(fault([](GnssFix& f) { f.covariance_enu(0, 1) = nan; }), HasSubstr("not finite"));
  EXPECT_THAT(fault([](GnssFix& f) { f.covariance_enu(2, 2) = -1.0; }), HasSubstr("eigenvalue"));
  EXPECT_EQ(fault([](GnssFix& f) { f.covariance_enu.setZero(); }), "");
  const Eigen::Vector3d along(1.3, 0.7, 0.1);
  EXPECT_EQ(fault([&](GnssFix& f) { f.covariance_enu = along * along.transpose(); }), "");
}

TEST(GnssFix, LatitudeAndLongitudeZeroAreThoseOfAReceiverThatKnowsNoPlace) {
  EXPECT_THAT(fault_of({.latitude_deg = 0.0, .longitude_deg = 0.0}), HasSubstr("longitude are 0"));
  EXPECT_EQ(fault_of({.latitude_deg = 0.0, .longitude_deg = 8.4}), "");
  EXPECT_EQ(fault_of({.latitude_deg = 49.0, .longitude_deg = 0.0}), "");
}

}  // namespace
}  // namespace stillmap
