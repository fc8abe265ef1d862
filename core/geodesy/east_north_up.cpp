#include "core/geodesy/east_north_up.hpp"

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <array>
#include <cmath>
#include <vector>

#include "core/lidar/angle_units.hpp"

namespace stillmap {

Eigen::Vector3d EastNorthUp::position_enu(const GnssFix& fix) const {
  const GeographicLib::LocalCartesian local(latitude_deg_, longitude_deg_, altitude_m_);
  const double altitude_m = std::isnan(fix.altitude_m) ? altitude_m_ : fix.altitude_m;
  Eigen::Vector3d position;
  local.Forward(fix.latitude_deg, fix.longitude_deg, altitude_m, position.x(), position.y(),
                position.z());
  return position;
}

GnssFix EastNorthUp::fix_at(const Eigen::Vector3d& position_enu) const {
  const GeographicLib::LocalCartesian local(latitude_deg_, longitude_deg_, altitude_m_);
  GnssFix fix;
  local.Reverse(position_enu.x(), position_enu.y(), position_enu.z(), fix.latitude_deg,
                fix.longitude_deg, fix.altitude_m);
  return fix;
}

Datum EastNorthUp::datum_of(const Eigen::Isometry3d& T_enu_map) const {
  const GnssFix origin = fix_at(T_enu_map.translation());
  // North is not the same everywhere: the axis is seen from the map's origin.
  const EastNorthUp at_map(origin.latitude_deg, origin.longitude_deg, origin.altitude_m);
  const Eigen::Vector3d along_x =
      at_map.position_enu(fix_at(T_enu_map * Eigen::Vector3d::UnitX().eval()));
  const double azimuth_deg = std::atan2(along_x.x(), along_x.y()) * deg_per_rad;
  return {.latitude_deg = origin.latitude_deg,
          .longitude_deg = origin.longitude_deg,
          .altitude_m = origin.altitude_m,
          .x_axis_azimuth_deg = azimuth_deg < 0.0 ? azimuth_deg + 360.0 : azimuth_deg};
}

Eigen::Isometry3d EastNorthUp::T_earth(const Eigen::Isometry3d& T_enu) const {
  Eigen::Isometry3d T_earth_enu = Eigen::Isometry3d::Identity();
  std::vector<double> row_major(9);
  GeographicLib::Geocentric::WGS84().Forward(
      latitude_deg_, longitude_deg_, altitude_m_, T_earth_enu.translation().x(),
      T_earth_enu.translation().y(), T_earth_enu.translation().z(), row_major);
  T_earth_enu.linear() =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(row_major.data());
  return T_earth_enu * T_enu;
}

}  // namespace stillmap
