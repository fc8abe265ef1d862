#include "core/lidar/ring_numbering.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "core/lidar/measured_elevation.hpp"

namespace stillmap {
namespace {

/// Which numbers, from 0 to the highest one, stand in the field.
std::vector<bool> standing_numbers(const Scan& scan) {
  std::vector<bool> stands(std::size_t{*std::ranges::max_element(scan.ring)} + 1, false);
  for (const std::uint16_t ring : scan.ring) stands[ring] = true;
  return stands;
}

std::size_t lowest_of(const std::vector<bool>& stands) {
  return static_cast<std::size_t>(std::ranges::find(stands, true) - stands.begin());
}

/// Greatest step that leads from the lowest number to all others.
std::size_t step_of(const std::vector<bool>& stands) {
  const std::size_t lowest = lowest_of(stands);
  std::size_t step = 0;
  for (std::size_t number = lowest; number < stands.size(); ++number)
    if (stands[number]) step = std::gcd(step, number - lowest);
  return std::max<std::size_t>(step, 1);
}

/// Whether so many numbers above the lowest are missing that the field does not use them: a third.
bool skips(const std::vector<bool>& stands) {
  const auto between = std::ssize(stands) - static_cast<std::ptrdiff_t>(lowest_of(stands));
  return 3 * std::ranges::count(stands, true) < 2 * between;
}

RingNumbering numbering_of(const std::vector<bool>& stands) {
  return {.ring_of_number = std::vector<std::uint16_t>(stands.size(), 0),
          .rings = 0,
          .numbers = static_cast<int>(std::ranges::count(stands, true))};
}

/// Every `step`-th number is a ring, the first `first`.
RingNumbering evenly(const std::vector<bool>& stands, std::size_t step, std::size_t first) {
  RingNumbering numbering = numbering_of(stands);
  for (std::size_t number = first * step; number < stands.size(); ++number)
    numbering.ring_of_number[number] = static_cast<std::uint16_t>(number / step - first);
  numbering.rings = numbering.ring_of_number.back() + 1;
  return numbering;
}

/// The numbers that stand are the rings.
RingNumbering one_after_another(const std::vector<bool>& stands) {
  RingNumbering numbering = numbering_of(stands);
  int ring = 0;
  for (std::size_t number = 0; number < stands.size(); ++number)
    if (stands[number]) numbering.ring_of_number[number] = static_cast<std::uint16_t>(ring++);
  numbering.rings = ring;
  return numbering;
}

/// Mean elevation of the points of each number [rad]; NAN without any.
std::vector<double> elevations_by_number(const Scan& scan, std::size_t numbers) {
  std::vector<double> sums(numbers, 0.0), points(numbers, 0.0);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const double elevation = measured_elevation(scan.points_lidar[i]);
    if (!std::isfinite(elevation)) continue;
    sums[scan.ring[i]] += elevation;
    points[scan.ring[i]] += 1.0;
  }
  for (std::size_t number = 0; number < numbers; ++number) sums[number] /= points[number];
  return sums;
}

/// How far the rings lie from the beams that their numbers, less `first`, mean [rad], by whichever
/// end the field counts from.
double distance_from_beams(const std::vector<double>& elevations, const SensorModel& sensor,
                           std::size_t first) {
  double from_top = 0.0, from_bottom = 0.0;
  for (std::size_t number = first; number < elevations.size(); ++number) {
    if (!std::isfinite(elevations[number])) continue;
    const auto ring = static_cast<int>(number - first);
    from_top += std::abs(elevations[number] - sensor.beam_elevation(ring));
    from_bottom += std::abs(elevations[number] - sensor.beam_elevation(sensor.rings - 1 - ring));
  }
  return std::min(from_top, from_bottom);
}

/// Whether a field whose lowest number is 1, and whose highest is below the sensor's rings, lacks
/// its highest ring rather than its lowest. The beams must say so clearly: those of data sheets
/// are a little beside the real ones.
bool counts_from_one(const Scan& scan, const SensorModel& sensor, std::size_t numbers) {
  const std::vector<double> elevations = elevations_by_number(scan, numbers);
  return 3.0 * distance_from_beams(elevations, sensor, 1) <
         distance_from_beams(elevations, sensor, 0);
}

}  // namespace

RingNumbering ring_numbering(const Scan& scan) {
  if (scan.ring.empty()) return {};
  const std::vector<bool> stands = standing_numbers(scan);
  const std::size_t step = step_of(stands);
  if (step == 1 && skips(stands)) return one_after_another(stands);
  return evenly(stands, step, lowest_of(stands) / step == 1 ? 1 : 0);
}

std::optional<RingNumbering> ring_numbering(const Scan& scan, const SensorModel& sensor) {
  if (scan.ring.empty()) return std::nullopt;
  const std::vector<bool> stands = standing_numbers(scan);
  const auto rings = static_cast<std::size_t>(sensor.rings);
  const std::size_t lowest = lowest_of(stands);
  if (stands.size() <= rings) {
    const bool is_from_one = lowest == 1 && scan.ring.size() == scan.size() &&
                             counts_from_one(scan, sensor, stands.size());
    return evenly(stands, 1, is_from_one ? 1 : 0);
  }
  for (const std::size_t step : {std::size_t{1}, step_of(stands)}) {
    const std::size_t highest = (stands.size() - 1) / step;
    if (highest < rings) return evenly(stands, step, 0);
    if (highest == rings && lowest / step >= 1) return evenly(stands, step, 1);
  }
  RingNumbering numbering = one_after_another(stands);
  if (skips(stands) && numbering.rings == sensor.rings) return numbering;
  return std::nullopt;
}

}  // namespace stillmap
