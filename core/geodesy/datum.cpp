#include "core/geodesy/datum.hpp"

#include <cmath>
#include <iomanip>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace stillmap {
namespace {

[[noreturn]] void refuse(const std::string& text, const std::string& fault) {
  throw std::invalid_argument("datum '" + text + "' " + fault +
                              "; give latitude,longitude[,altitude_m[,azimuth of the map's x axis]]"
                              " in degrees, as 48.137,11.575,519,90");
}

std::vector<double> numbers_in(const std::string& text) {
  std::vector<double> values;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    std::istringstream number(word);
    double value = 0.0;
    std::string rest;
    if (!(number >> value) || (number >> rest)) refuse(text, "has '" + word + "', no number");
    values.push_back(value);
  }
  if (values.size() < 2 || values.size() > 4) {
    refuse(text, "has " + std::to_string(values.size()) + " numbers");
  }
  return values;
}

}  // namespace

Datum datum_from_text(const std::string& text) {
  constexpr double max_latitude_deg = 84.0;
  constexpr double max_altitude_m = 1e5;
  const std::vector<double> values = numbers_in(text);
  Datum datum{.latitude_deg = values[0], .longitude_deg = values[1]};
  if (values.size() > 2) datum.altitude_m = values[2];
  if (values.size() > 3) datum.x_axis_azimuth_deg = values[3];
  // Negated, so that NaN is refused too.
  if (!(std::abs(datum.latitude_deg) <= max_latitude_deg)) {
    refuse(text, "has a latitude beyond 84 degrees");
  }
  if (!(std::abs(datum.longitude_deg) <= 180.0)) refuse(text, "has a longitude beyond 180 degrees");
  if (!(std::abs(datum.altitude_m) <= max_altitude_m)) refuse(text, "has no usable altitude");
  if (!(std::abs(datum.x_axis_azimuth_deg) <= 360.0)) refuse(text, "has no usable azimuth");
  return datum;
}

std::string to_text(const Datum& datum) {
  constexpr int degree_digits = 8;
  constexpr int metre_digits = 3;
  constexpr int azimuth_digits = 4;
  std::ostringstream text;
  text << std::fixed << std::setprecision(degree_digits) << datum.latitude_deg << ','
       << datum.longitude_deg << ',' << std::setprecision(metre_digits) << datum.altitude_m << ','
       << std::setprecision(azimuth_digits) << datum.x_axis_azimuth_deg;
  return text.str();
}

}  // namespace stillmap
