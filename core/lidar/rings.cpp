#include "core/lidar/rings.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <limits>
#include <span>
#include <utility>

#include "core/lidar/measured_elevation.hpp"
#include "core/lidar/ranked_value.hpp"
#include "core/lidar/ring_numbering.hpp"

namespace stillmap {
namespace {

/// One turn in the measure of `diamond_angle`.
constexpr float turn = 4.0F;
/// Steps back up to this are jitter (real KITTI scans have some of 7 degrees), larger ones are the
/// jump to the next ring: about 20 degrees.
constexpr float max_step_back = turn * 20.0F / 360.0F;

/// Grows with the azimuth from 0 at +x to 4, at a fraction of atan2's cost. NAN of points without
/// one, as those that were not measured.
float diamond_angle(const Eigen::Vector3f& p) {
  const float norm = std::abs(p.x()) + std::abs(p.y());
  if (!(norm > 0.0F) || !std::isfinite(norm)) return std::numeric_limits<float>::quiet_NaN();
  const float side = p.x() / norm;
  return p.y() >= 0.0F ? 1.0F - side : 3.0F + side;
}

/// Tangent of the elevation; NAN of points that are not finite.
float slope(const Eigen::Vector3f& p) {
  if (!p.allFinite()) return std::numeric_limits<float>::quiet_NaN();
  return p.z() / std::sqrt(p.x() * p.x() + p.y() * p.y());
}

template <class T, class Function>
std::vector<T> of_each_point(const Scan& scan, Function function) {
  std::vector<T> values(scan.size());
  std::ranges::transform(scan.points_lidar, values.begin(), function);
  return values;
}

/// +1 when the azimuth mostly rises from point to point, else -1.
float sense_of_rotation(std::span<const float> angles) {
  std::ptrdiff_t balance = 0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const float step = angles[i] - angles[i - 1];
    if (std::abs(step) < turn / 2.0F) balance += (step > 0.0F ? 1 : 0) - (step < 0.0F ? 1 : 0);
  }
  return balance >= 0 ? 1.0F : -1.0F;
}

/// The azimuth of each point as it grows through all rings, in turns of 4. Backward steps beyond
/// jitter count as steps forward into the next ring.
std::vector<float> unwrapped_azimuth(const Scan& scan) {
  std::vector<float> azimuth = of_each_point<float>(scan, diamond_angle);
  const float sense = sense_of_rotation(azimuth);
  float last = 0.0F;
  double sum = 0.0;
  for (float& entry : azimuth) {
    if (std::isnan(entry)) {
      entry = static_cast<float>(sum);
      continue;
    }
    const float angle = sense > 0.0F ? entry : turn - entry;
    float step = angle - last;
    if (step < -max_step_back) step += turn;
    // Also at the first point: a file may begin a little before the seam.
    if (step >= turn - max_step_back) step -= turn;
    sum += step;
    last = angle;
    entry = static_cast<float>(sum);
  }
  return azimuth;
}

/// Ring of each point when rings begin at azimuth `seam`; never falls, whatever the jitter there.
std::vector<std::uint16_t> cut_at(std::span<const float> azimuth, float seam) {
  std::vector<std::uint16_t> rings;
  rings.reserve(azimuth.size());
  int highest = 0;
  for (const float angle : azimuth) {
    highest = std::max(highest, static_cast<int>(std::floor((angle - seam) / turn)));
    rings.push_back(static_cast<std::uint16_t>(
        std::min<int>(highest, std::numeric_limits<std::uint16_t>::max())));
  }
  return rings;
}

/// What happens to the slope at the cuts of a seam: medians over the cuts.
struct StepsAtCuts {
  /// Difference from the step between the sensor's beams: small where rings end.
  float from_next_beam = std::numeric_limits<float>::infinity();
  /// The step itself: small where a ring only goes on.
  float from_same_beam = std::numeric_limits<float>::infinity();
  float between_beams = 0.0F;

  /// Neither where the scan is compensated for its motion and the sweep began there.
  [[nodiscard]] bool is_clear() const {
    return std::min(from_next_beam, from_same_beam) < 0.5F * between_beams;
  }
};

/// `slopes` and `rings` are of the points that were measured, in their order.
StepsAtCuts steps_at_cuts(std::span<const float> slopes, std::span<const std::uint16_t> rings,
                          const SensorModel& sensor) {
  constexpr std::size_t points_on_each_side = 5;
  const auto median_slope = [&](std::size_t begin) {
    const auto side = slopes.subspan(begin, points_on_each_side);
    std::vector<float> values(side.begin(), side.end());
    return median_of(values);
  };
  std::vector<float> from_next_beam, from_same_beam, between_beams;
  for (std::size_t i = points_on_each_side; i + points_on_each_side <= rings.size(); ++i) {
    if (rings[i] == rings[i - 1] || rings[i] >= sensor.rings) continue;
    const auto beams = static_cast<float>(std::tan(sensor.beam_elevation(rings[i] - 1)) -
                                          std::tan(sensor.beam_elevation(rings[i])));
    const float step = median_slope(i - points_on_each_side) - median_slope(i);
    if (!std::isfinite(step)) continue;
    from_next_beam.push_back(std::abs(step - beams));
    from_same_beam.push_back(std::abs(step));
    between_beams.push_back(beams);
  }
  if (from_next_beam.empty()) return {};
  return {median_of(from_next_beam), median_of(from_same_beam), median_of(between_beams)};
}

/// Whether the first of two seams, half a turn apart, is where rings end.
bool is_seam(const StepsAtCuts& first, const StepsAtCuts& second) {
  if (!first.is_clear() && !second.is_clear()) return first.from_next_beam <= second.from_next_beam;
  float evidence = 0.0F;
  if (first.is_clear()) evidence += first.from_same_beam - first.from_next_beam;
  if (second.is_clear()) evidence -= second.from_same_beam - second.from_next_beam;
  return evidence >= 0.0F;
}

/// Whether ring numbers grow downwards: the mean ring of the upper half is the smaller one.
bool numbered_from_top(const Scan& scan) {
  double rings = 0.0, sines = 0.0, products = 0.0;
  double count = 0.0;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const Eigen::Vector3f& p = scan.points_lidar[i];
    if (!is_measured(p)) continue;
    // Of the elevation: the tangent of one point beside the axis would outweigh all others.
    const double sine = p.z() / p.norm();
    count += 1.0;
    rings += scan.ring[i];
    sines += sine;
    products += scan.ring[i] * sine;
  }
  return products * count <= rings * sines;
}

std::vector<std::uint16_t> rings_from_field(const Scan& scan, const SensorModel& sensor,
                                            const RingNumbering& numbering) {
  std::vector<std::uint16_t> rings = scan.ring;
  const bool is_from_top = numbered_from_top(scan);
  const auto last = static_cast<std::uint16_t>(sensor.rings - 1);
  for (auto& ring : rings) {
    ring = numbering.ring_of(ring);
    if (!is_from_top) ring = static_cast<std::uint16_t>(last - ring);
  }
  return rings;
}

bool tells_rings(const Scan& scan, const SensorModel& sensor) {
  if (scan.ring.empty() || scan.ring.size() != scan.size()) return false;
  // Converters that do not know the ring write the same number, 0, into all points.
  const bool tells_nothing =
      sensor.rings > 1 && scan.size() > 1 &&
      std::ranges::all_of(scan.ring, [&](std::uint16_t ring) { return ring == scan.ring[0]; });
  return !tells_nothing;
}

}  // namespace

std::vector<std::uint16_t> rings_from_elevation(const Scan& scan, const SensorModel& sensor) {
  // Slopes halfway between neighbouring beams, from the highest down.
  std::vector<float> borders;
  for (int ring = 0; ring + 1 < sensor.rings; ++ring) {
    const double middle = 0.5 * (sensor.beam_elevation(ring) + sensor.beam_elevation(ring + 1));
    borders.push_back(static_cast<float>(std::tan(middle)));
  }
  std::vector<std::uint16_t> rings;
  rings.reserve(scan.size());
  for (const auto& p : scan.points_lidar) {
    const float s = slope(p);
    const auto below = std::ranges::lower_bound(borders, s, std::greater<>{});
    rings.push_back(std::isnan(s) ? std::uint16_t{0}
                                  : static_cast<std::uint16_t>(below - borders.begin()));
  }
  return rings;
}

std::vector<std::uint16_t> rings_from_order(const Scan& scan, const SensorModel& sensor) {
  const std::vector<float> slopes = of_each_point<float>(scan, slope);
  std::vector<float> measured_slopes;
  measured_slopes.reserve(slopes.size());
  std::ranges::copy_if(slopes, std::back_inserter(measured_slopes),
                       [](float s) { return !std::isnan(s); });
  const auto steps = [&](std::span<const std::uint16_t> rings) {
    std::vector<std::uint16_t> measured_rings;
    measured_rings.reserve(measured_slopes.size());
    for (std::size_t i = 0; i < slopes.size(); ++i) {
      if (!std::isnan(slopes[i])) measured_rings.push_back(rings[i]);
    }
    return steps_at_cuts(measured_slopes, measured_rings, sensor);
  };
  auto [from_front, from_back] = turns_in_order(scan);
  const bool front_is_better = is_seam(steps(from_front), steps(from_back));
  std::vector<std::uint16_t> rings = std::move(front_is_better ? from_front : from_back);

  // A scan loses whole rings to the sky, and a late point may open one too many.
  const int found = rings.empty() ? 0 : rings.back() + 1;
  if (found < sensor.rings / 2 || found > sensor.rings + 1) return {};
  const auto last = static_cast<std::uint16_t>(sensor.rings - 1);
  for (auto& ring : rings) ring = std::min(ring, last);
  return rings;
}

std::array<std::vector<std::uint16_t>, 2> turns_in_order(const Scan& scan) {
  const std::vector<float> azimuth = unwrapped_azimuth(scan);
  return {cut_at(azimuth, 0.0F), cut_at(azimuth, turn / 2.0F)};
}

std::vector<std::uint16_t> assign_rings(const Scan& scan, const SensorModel& sensor) {
  if (tells_rings(scan, sensor)) {
    if (const auto numbering = ring_numbering(scan, sensor))
      return rings_from_field(scan, sensor, *numbering);
  }
  if (sensor.ring_source == RingSource::order) {
    if (auto rings = rings_from_order(scan, sensor); !rings.empty()) return rings;
  }
  return rings_from_elevation(scan, sensor);
}

}  // namespace stillmap
