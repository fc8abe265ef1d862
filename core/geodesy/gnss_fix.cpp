#include "core/geodesy/gnss_fix.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace stillmap {
namespace {

constexpr double max_latitude_deg = 84.0;
constexpr double max_altitude_m = 1e5;

std::string named(const char* field, double value) {
  return std::string(field) + " is " + std::to_string(value);
}

}  // namespace

std::string fault_of(const GnssFix& fix) {
  // Negated, so that NaN is refused too.
  if (!(std::abs(fix.latitude_deg) <= max_latitude_deg))
    return named("the latitude", fix.latitude_deg) + ", beyond 84 degrees";
  if (!(std::abs(fix.longitude_deg) <= 360.0))
    return named("the longitude", fix.longitude_deg) + ", beyond 360 degrees";
  if (fix.latitude_deg == 0.0 && fix.longitude_deg == 0.0)
    return "the latitude and the longitude are 0, as those of a receiver that knows no place yet";
  if (!(std::abs(fix.altitude_m) <= max_altitude_m) && !std::isnan(fix.altitude_m))
    return named("the altitude", fix.altitude_m) + ", beyond 100 km";
  if (!fix.covariance_enu.allFinite()) return "the covariance is not finite";
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(fix.covariance_enu,
                                                            Eigen::EigenvaluesOnly);
  // One that is known along two axes alone has eigenvalues about zero.
  constexpr double rounding = 1e-9;
  if (!(axes.eigenvalues().minCoeff() >= -rounding * axes.eigenvalues().maxCoeff()))
    return named("the smallest eigenvalue of the covariance", axes.eigenvalues().minCoeff());
  return "";
}

}  // namespace stillmap
