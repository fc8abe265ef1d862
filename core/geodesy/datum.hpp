#pragma once

#include <string>

namespace stillmap {

/// Where a map lies on the earth (WGS 84).
struct Datum {
  /// Of the map's origin.
  double latitude_deg = 0.0;
  double longitude_deg = 0.0;
  /// Of map height 0, in the height reference of the user.
  double altitude_m = 0.0;
  /// Where the map's x axis points, clockwise from north: a map begins with x along the vehicle.
  double x_axis_azimuth_deg = 90.0;
};

/// Reads "latitude,longitude[,altitude[,azimuth]]". Throws std::invalid_argument that names the
/// fault in `text`. Latitudes beyond 84 degrees are refused: the transverse Mercator projection
/// degenerates at the poles.
[[nodiscard]] Datum datum_from_text(const std::string& text);
/// What datum_from_text() reads back to the millimetre.
[[nodiscard]] std::string to_text(const Datum& datum);

}  // namespace stillmap
