#pragma once

#include <string>

namespace stillmap {

/// Where a map lies on the earth (WGS 84).
struct Datum {
  /// Of the map's origin.
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  /// Of map height 0, above whatever the user measures from.
  double altitude_m = 0.0;
  /// Where the map's x axis points, clockwise from north: a map begins with x along the vehicle.
  double x_axis_azimuth_deg = 90.0;
};

/// Reads "latitude,longitude[,altitude[,azimuth]]". Throws std::invalid_argument naming what is
/// wrong with `text`. A map must lie between 84 degrees north and south: beyond, its projection is
/// of no use.
[[nodiscard]] Datum datum_from_text(const std::string& text);

}  // namespace stillmap
