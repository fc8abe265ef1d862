#include "core/lidar/rings.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <span>
#include <utility>

namespace stillmap {
namespace {

/// One turn in the measure of `diamond_angle`.
constexpr float turn = 4.0F;
/// Steps back up to this are jitter (real KITTI scans have some of 7 degrees), larger ones are the
/// jump to the next ring: about 20 degrees.
constexpr float max_step_back = turn * 20.0F / 360.0F;

/// Grows with the azimuth from 0 at +x to 4, at a fraction of atan2's cost.
float diamond_angle(const Eigen::Vector3f& p) {
  const float norm = std::abs(p.x()) + std::abs(p.y());
  if (!(norm > 0.0F) || !std::isfinite(norm)) return 0.0F;
  const float side = p.x() / norm;
  return p.y() >= 0.0F ? 1.0F - side : 3.0F + side;
}

/// Tangent of the elevation.
float slope(const Eigen::Vector3f& p) { return p.z() / std::sqrt(p.x() * p.x() + p.y() * p.y()); }

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

/// Squared distances of the points' slopes from their ring's mean: small when the cut is right.
double spread_within_rings(std::span<const float> slopes, std::span<const std::uint16_t> rings) {
  double squares = 0.0;
  double sum = 0.0, sum_of_squares = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < rings.size(); ++i) {
    if (const double s = slopes[i]; std::isfinite(s)) {
      sum += s;
      sum_of_squares += s * s;
      ++count;
    }
    const bool last_of_ring = i + 1 == rings.size() || rings[i + 1] != rings[i];
    if (last_of_ring && count > 0) {
      squares += sum_of_squares - sum * sum / static_cast<double>(count);
      sum = sum_of_squares = 0.0;
      count = 0;
    }
  }
  return squares;
}

/// Whether ring numbers grow downwards: the mean ring of the upper half is the smaller one.
bool numbered_from_top(const Scan& scan) {
  double mean_ring = 0.0, mean_slope = 0.0;
  double covariance = 0.0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const double s = slope(scan.points_lidar[i]);
    if (!std::isfinite(s)) continue;
    const double ring_step = scan.ring[i] - mean_ring;
    ++count;
    mean_ring += ring_step / static_cast<double>(count);
    mean_slope += (s - mean_slope) / static_cast<double>(count);
    covariance += ring_step * (s - mean_slope);
  }
  return covariance <= 0.0;
}

std::vector<std::uint16_t> rings_from_field(const Scan& scan, const SensorModel& sensor) {
  std::vector<std::uint16_t> rings = scan.ring;
  if (numbered_from_top(scan)) return rings;
  const auto last = static_cast<std::uint16_t>(sensor.rings - 1);
  for (auto& ring : rings) ring = static_cast<std::uint16_t>(last - ring);
  return rings;
}

bool field_fits(const Scan& scan, const SensorModel& sensor) {
  return scan.ring.size() == scan.size() &&
         std::ranges::all_of(scan.ring, [&](std::uint16_t ring) { return ring < sensor.rings; });
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
  const std::vector<float> azimuth = unwrapped_azimuth(scan);
  const std::vector<float> slopes = of_each_point<float>(scan, slope);
  std::vector<std::uint16_t> from_front = cut_at(azimuth, 0.0F);
  std::vector<std::uint16_t> from_back = cut_at(azimuth, turn / 2.0F);
  const bool front_is_better =
      spread_within_rings(slopes, from_front) <= spread_within_rings(slopes, from_back);
  std::vector<std::uint16_t> rings = std::move(front_is_better ? from_front : from_back);

  // A scan loses whole rings to the sky, and a late point may open one too many.
  const int found = rings.empty() ? 0 : rings.back() + 1;
  if (found < sensor.rings / 2 || found > sensor.rings + 1) return {};
  const auto last = static_cast<std::uint16_t>(sensor.rings - 1);
  for (auto& ring : rings) ring = std::min(ring, last);
  return rings;
}

std::vector<std::uint16_t> assign_rings(const Scan& scan, const SensorModel& sensor) {
  if (!scan.ring.empty() && field_fits(scan, sensor)) return rings_from_field(scan, sensor);
  if (sensor.ring_source == RingSource::order) {
    if (auto rings = rings_from_order(scan, sensor); !rings.empty()) return rings;
  }
  return rings_from_elevation(scan, sensor);
}

}  // namespace stillmap
