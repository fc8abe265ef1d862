#include "idl/conversions/imu.hpp"

#include "idl/conversions/header.hpp"

namespace stillmap::wire {
namespace {

geometry_msgs::msg::Vector3 to_vector(const Eigen::Vector3d& v) {
  geometry_msgs::msg::Vector3 out;
  out.x(v.x());
  out.y(v.y());
  out.z(v.z());
  return out;
}

Eigen::Vector3d from_vector(const geometry_msgs::msg::Vector3& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

sensor_msgs::msg::Imu to_imu(const ImuSample& sample, const std::string& imu_frame) {
  sensor_msgs::msg::Imu imu;
  imu.header(to_header(sample.stamp_ns, imu_frame));
  imu.orientation().w(1.0);
  imu.orientation_covariance()[0] = -1.0;
  imu.angular_velocity(to_vector(sample.angular_velocity_imu));
  imu.linear_acceleration(to_vector(sample.acceleration_imu));
  return imu;
}

std::optional<ImuSample> from_imu(const sensor_msgs::msg::Imu& imu) {
  const auto stamp = stamp_ns(imu.header().stamp());
  if (!stamp) return std::nullopt;
  return ImuSample{.stamp_ns = *stamp,
                   .angular_velocity_imu = from_vector(imu.angular_velocity()),
                   .acceleration_imu = from_vector(imu.linear_acceleration())};
}

}  // namespace stillmap::wire
