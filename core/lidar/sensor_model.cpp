#include "core/lidar/sensor_model.hpp"

#include <cassert>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <sstream>

namespace stillmap {
namespace {

constexpr double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }
constexpr double degrees(double radians) { return radians * 180.0 / std::numbers::pi; }

constexpr int max_rings = 1024;
constexpr int max_columns = 65536;
/// More is no fault of a lidar, but of how it is mounted.
constexpr double max_elevation_offset = radians(5.0);

void check_beams(const SensorModel& sensor, std::ostream& faults) {
  const auto& beams = sensor.beam_elevations;
  if (beams.empty()) return;
  if (beams.size() != static_cast<std::size_t>(sensor.rings)) {
    faults << "beam_elevations has " << beams.size() << " entries for rings = " << sensor.rings
           << "; give one a ring, or none for even spacing\n";
  }
  for (std::size_t i = 0; i < beams.size(); ++i) {
    if (!(beams[i] >= sensor.fov_down && beams[i] <= sensor.fov_up)) {
      faults << "beam_elevations[" << i << "] = " << degrees(beams[i])
             << " deg lies outside fov_down..fov_up\n";
    }
    if (i > 0 && !(beams[i] < beams[i - 1])) {
      faults << "beam_elevations[" << i << "] = " << degrees(beams[i])
             << " deg is not below its neighbour; list the beams from the highest down\n";
    }
  }
}

void check_field_of_view(const SensorModel& sensor, std::ostream& faults) {
  constexpr double quarter_turn = std::numbers::pi / 2.0;
  if (!(std::abs(sensor.fov_up) <= quarter_turn)) {
    faults << "fov_up = " << degrees(sensor.fov_up) << " deg; must be within -90..90\n";
  }
  if (!(std::abs(sensor.fov_down) <= quarter_turn)) {
    faults << "fov_down = " << degrees(sensor.fov_down) << " deg; must be within -90..90\n";
  }
  if (!(sensor.fov_down < sensor.fov_up)) {
    faults << "fov_down = " << degrees(sensor.fov_down)
           << " deg; must be below fov_up = " << degrees(sensor.fov_up) << " deg\n";
  }
}

bool positive_and_finite(double value) { return value > 0.0 && std::isfinite(value); }

}  // namespace

std::string SensorModel::faults() const {
  std::ostringstream faults;
  if (rings < 1 || rings > max_rings) {
    faults << "rings = " << rings << "; must be 1.." << max_rings << '\n';
  }
  if (columns < 1 || columns > max_columns) {
    faults << "columns = " << columns << "; must be 1.." << max_columns << '\n';
  }
  check_field_of_view(*this, faults);
  check_beams(*this, faults);
  if (!(std::abs(elevation_offset) <= max_elevation_offset)) {
    faults << "elevation_offset = " << degrees(elevation_offset) << " deg; must be within -"
           << degrees(max_elevation_offset) << ".." << degrees(max_elevation_offset) << '\n';
  }
  if (!(min_range_m >= 0.0 && std::isfinite(min_range_m))) {
    faults << "min_range_m = " << min_range_m << "; must be 0 or more\n";
  }
  if (!(max_range_m > min_range_m && std::isfinite(max_range_m))) {
    faults << "max_range_m = " << max_range_m
           << "; must be finite and above min_range_m = " << min_range_m << '\n';
  }
  if (!positive_and_finite(period_s)) {
    faults << "period_s = " << period_s << "; must be above 0\n";
  }
  if (!positive_and_finite(intensity_scale)) {
    faults << "intensity_scale = " << intensity_scale << "; must be above 0\n";
  }
  return faults.str();
}

double SensorModel::beam_elevation(int ring) const {
  assert(ring >= 0 && ring < rings);
  if (!beam_elevations.empty()) return beam_elevations[static_cast<std::size_t>(ring)];
  return fov_up - (ring + 0.5) * (fov_up - fov_down) / rings;
}

SensorModel hdl_64e() {
  SensorModel sensor;
  sensor.name = "HDL-64E";
  sensor.rings = 64;
  sensor.fov_up = radians(3.0);
  sensor.fov_down = radians(-25.0);
  // Two blocks of lasers: a dense upper and a coarser lower one.
  for (int i = 0; i < 32; ++i) sensor.beam_elevations.push_back(radians(2.0 - i / 3.0));
  for (int i = 0; i < 32; ++i) sensor.beam_elevations.push_back(radians(-8.83 - i / 2.0));
  sensor.ring_source = RingSource::order;
  return sensor;
}

SensorModel hdl_32e() {
  SensorModel sensor;
  sensor.name = "HDL-32E";
  sensor.rings = 32;
  sensor.fov_up = radians(34.0 / 3.0);
  sensor.fov_down = radians(-94.0 / 3.0);
  sensor.max_range_m = 100.0;
  sensor.intensity_scale = 1.0F / 255.0F;
  return sensor;
}

SensorModel vlp_16() {
  SensorModel sensor;
  sensor.name = "VLP-16";
  sensor.rings = 16;
  sensor.fov_up = radians(16.0);
  sensor.fov_down = radians(-16.0);
  sensor.max_range_m = 100.0;
  sensor.intensity_scale = 1.0F / 255.0F;
  return sensor;
}

}  // namespace stillmap
