#include "core/geodesy/east_north_up.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace stillmap {
namespace {

constexpr double degree = std::numbers::pi / 180.0;
constexpr double latitude_deg = 49.0;
constexpr double longitude_deg = 8.4;
constexpr double altitude_m = 115.0;
const EastNorthUp enu(latitude_deg, longitude_deg, altitude_m);

// WGS 84: half axis a, first eccentricity squared.
constexpr double a_m = 6378137.0;
constexpr double e2 = 6.69437999014e-3;

// The ellipsoid's radii of curvature, written down anew.
TEST(EastNorthUp, SmallStepsAreTheRadiiOfCurvature) {
  const double s = std::sin(latitude_deg * degree);
  const double w = std::sqrt(1.0 - e2 * s * s);
  const double meridian_m = a_m * (1.0 - e2) / (w * w * w) + altitude_m;
  const double parallel_m = (a_m / w + altitude_m) * std::cos(latitude_deg * degree);
  constexpr double step_deg = 1e-4;
  GnssFix fix{.latitude_deg = latitude_deg + step_deg,
              .longitude_deg = longitude_deg,
              .altitude_m = altitude_m};
  EXPECT_NEAR(enu.position_enu(fix).y(), meridian_m * step_deg * degree, 1e-3);
  EXPECT_NEAR(enu.position_enu(fix).x(), 0.0, 1e-6);
  fix.latitude_deg = latitude_deg;
  fix.longitude_deg += step_deg;
  fix.altitude_m += 2.5;
  EXPECT_NEAR(enu.position_enu(fix).x(), parallel_m * step_deg * degree, 1e-3);
  EXPECT_NEAR(enu.position_enu(fix).z(), 2.5, 1e-3);
}

TEST(EastNorthUp, PlacesComeBack) {
  const Eigen::Vector3d position(-1234.5, 987.6, -54.3);
  EXPECT_LT((enu.position_enu(enu.fix_at(position)) - position).norm(), 1e-6);
}

TEST(EastNorthUp, AFixWithoutAnAltitudeIsAtTheOrigins) {
  const GnssFix fix{.latitude_deg = latitude_deg,
                    .longitude_deg = longitude_deg,
                    .altitude_m = std::numeric_limits<double>::quiet_NaN()};
  EXPECT_LT(enu.position_enu(fix).norm(), 1e-6);
}

TEST(EastNorthUp, ADatumHasTheOriginAndTheAzimuthClockwiseFromNorth) {
  const Eigen::Isometry3d T_enu_map = Eigen::Translation3d(100.0, -200.0, 5.0) *
                                      Eigen::AngleAxisd(30.0 * degree, Eigen::Vector3d::UnitZ());
  const Datum datum = enu.datum_of(T_enu_map);
  const GnssFix origin = enu.fix_at(T_enu_map.translation());
  EXPECT_NEAR(datum.latitude_deg, origin.latitude_deg, 1e-9);
  EXPECT_NEAR(datum.longitude_deg, origin.longitude_deg, 1e-9);
  EXPECT_NEAR(datum.altitude_m, altitude_m + 5.0, 0.01);
  EXPECT_NEAR(datum.x_axis_azimuth_deg, 60.0, 0.002);
  const Eigen::Isometry3d T_west(Eigen::AngleAxisd(170.0 * degree, Eigen::Vector3d::UnitZ()));
  EXPECT_NEAR(enu.datum_of(T_west).x_axis_azimuth_deg, 280.0, 0.002);
}

TEST(EastNorthUp, TheEarthFrameIsInItsCentreWithZToThePole) {
  const Eigen::Isometry3d T_earth_enu = enu.T_earth(Eigen::Isometry3d::Identity());
  const double s = std::sin(latitude_deg * degree), c = std::cos(latitude_deg * degree);
  const double prime_vertical_m = a_m / std::sqrt(1.0 - e2 * s * s);
  const Eigen::Vector3d expected(
      (prime_vertical_m + altitude_m) * c * std::cos(longitude_deg * degree),
      (prime_vertical_m + altitude_m) * c * std::sin(longitude_deg * degree),
      (prime_vertical_m * (1.0 - e2) + altitude_m) * s);
  EXPECT_LT((T_earth_enu.translation() - expected).norm(), 1e-3);
  EXPECT_NEAR(T_earth_enu.linear().determinant(), 1.0, 1e-12);
  EXPECT_NEAR(T_earth_enu.linear()(2, 1), c, 1e-12) << "north points to the pole";
  EXPECT_NEAR(T_earth_enu.linear()(2, 2), s, 1e-12) << "up away from the equator";
  EXPECT_NEAR(T_earth_enu.linear()(2, 0), 0.0, 1e-12);
}

}  // namespace
}  // namespace stillmap
