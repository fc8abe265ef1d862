#include "idl/conversions/gnss.hpp"

#include <cstdint>
#include <utility>

#include "idl/conversions/header.hpp"

namespace stillmap::wire {
namespace {

using Covariance = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
namespace constants = sensor_msgs::msg::NavSatFix_Constants;

/// NavSatStatus.SERVICE_GPS.
constexpr std::uint16_t service_gps = 1;

/// A receiver of single frequency.
const Eigen::Vector3d unknown_sigma_enu_m(3.0, 3.0, 6.0);

}  // namespace

ReceivedFix from_nav_sat_fix(const sensor_msgs::msg::NavSatFix& message) {
  if (static_cast<std::int8_t>(message.status().status()) < 0) return {};
  const auto stamp = stamp_ns(message.header().stamp());
  if (!stamp) return {std::nullopt, "its stamp cannot be used"};
  GnssFix fix{.stamp_ns = *stamp,
              .latitude_deg = message.latitude(),
              .longitude_deg = message.longitude(),
              .altitude_m = message.altitude()};
  const Eigen::Map<const Covariance> said(message.position_covariance().data());
  // Drivers leave zeros where they know nothing, whatever the type says.
  const bool is_known =
      message.position_covariance_type() != constants::COVARIANCE_TYPE_UNKNOWN && !said.isZero(0.0);
  fix.covariance_enu = unknown_sigma_enu_m.cwiseAbs2().asDiagonal();
  if (is_known) fix.covariance_enu = said;
  if (std::string fault = fault_of(fix); !fault.empty()) return {std::nullopt, std::move(fault)};
  return {fix, ""};
}

sensor_msgs::msg::NavSatFix to_nav_sat_fix(const GnssFix& fix, const std::string& antenna_frame) {
  sensor_msgs::msg::NavSatFix message;
  message.header(to_header(fix.stamp_ns, antenna_frame));
  message.status().service(service_gps);
  message.latitude(fix.latitude_deg);
  message.longitude(fix.longitude_deg);
  message.altitude(fix.altitude_m);
  Eigen::Map<Covariance>(message.position_covariance().data()) = fix.covariance_enu;
  message.position_covariance_type(constants::COVARIANCE_TYPE_KNOWN);
  return message;
}

}  // namespace stillmap::wire
