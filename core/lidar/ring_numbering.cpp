#include "core/lidar/ring_numbering.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "core/lidar/measured_elevation.hpp"

namespace stillmap {
namespace {

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

/// Whether it is the greatest number of 8 or of 16 bits, and stands at no measured point.
bool is_no_ring(const Scan& scan, std::size_t number) {
  if ((number != 255 && number != 65535) || scan.ring.size() != scan.size()) return false;
  for (std::size_t i = 0; i < scan.size(); ++i)
    if (scan.ring[i] == number && is_measured(scan.points_lidar[i])) return false;
  return true;
}

/// Which numbers, from 0 to the highest one that is a ring's, stand in the field.
std::vector<bool> standing_numbers(const Scan& scan) {
  std::vector<bool> stands(std::size_t{*std::ranges::max_element(scan.ring)} + 1, false);
  for (const std::uint16_t ring : scan.ring) stands[ring] = true;
  const std::size_t highest = stands.size() - 1;
  if (!is_no_ring(scan, highest)) return stands;
  std::vector<bool> others(stands.begin(), stands.end() - 1);
  while (!others.empty() && !others.back()) others.pop_back();
  if (others.empty()) return stands;
  // One step above the others it may be a ring that saw nothing.
  return highest < others.size() + step_of(others) ? stands : others;
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

/// A way to count: every `step`-th number is a ring, the first `first`.
struct Counting {
  std::size_t step = 1;
  std::size_t first = 0;
};

/// The ways by which no number means a ring beyond the sensor's, the most usual first.
std::vector<Counting> possible_countings(const std::vector<bool>& stands, std::size_t rings) {
  std::vector<std::size_t> steps = {1};
  if (step_of(stands) > 1) steps.push_back(step_of(stands));
  std::vector<Counting> possible;
  for (const std::size_t step : steps) {
    const std::size_t lowest = lowest_of(stands) / step, highest = (stands.size() - 1) / step;
    if (highest < rings) possible.push_back({step, 0});
    // A lower ring may have seen nothing: it counts from one only where all rings are needed.
    const bool is_from_one = lowest == 1 || (lowest > 1 && highest == rings);
    if (is_from_one && highest <= rings) possible.push_back({step, 1});
  }
  return possible;
}

/// How far the rings lie from the beams that they are by this counting, summed [rad], by whichever
/// end the field counts from.
double distance_from_beams(const std::vector<double>& elevations, const SensorModel& sensor,
                           const Counting& counting) {
  double from_top = 0.0, from_bottom = 0.0;
  for (std::size_t number = 0; number < elevations.size(); ++number) {
    if (!std::isfinite(elevations[number])) continue;
    const auto ring = static_cast<int>(number / counting.step - counting.first);
    from_top += std::abs(elevations[number] - sensor.beam_elevation(ring));
    from_bottom += std::abs(elevations[number] - sensor.beam_elevation(sensor.rings - 1 - ring));
  }
  return std::min(from_top, from_bottom);
}

/// The most usual counting, unless the beams say clearly that it is another: those of data sheets
/// are a little beside the real ones.
Counting told_by_beams(const std::vector<Counting>& possible, const Scan& scan,
                       const SensorModel& sensor, std::size_t numbers) {
  Counting told = possible.front();
  if (possible.size() == 1 || scan.ring.size() != scan.size()) return told;
  const std::vector<double> elevations = elevations_by_number(scan, numbers);
  double distance = distance_from_beams(elevations, sensor, told);
  for (const Counting& other : possible) {
    const double others = distance_from_beams(elevations, sensor, other);
    if (3.0 * others >= distance) continue;
    told = other;
    distance = others;
  }
  return told;
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
  const auto possible = possible_countings(stands, static_cast<std::size_t>(sensor.rings));
  if (!possible.empty()) {
    const auto [step, first] = told_by_beams(possible, scan, sensor, stands.size());
    return evenly(stands, step, first);
  }
  RingNumbering numbering = one_after_another(stands);
  if (skips(stands) && numbering.rings == sensor.rings) return numbering;
  return std::nullopt;
}

}  // namespace stillmap
