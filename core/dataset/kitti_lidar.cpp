#include "core/dataset/kitti_lidar.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/measured_elevation.hpp"
#include "core/lidar/prepare.hpp"
#include "core/lidar/ranked_value.hpp"
#include "core/lidar/rings.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {
namespace {

constexpr double elevation_offset = 0.205 * rad_per_deg;
constexpr std::size_t rings_of_block = 32;

/// How far the median elevations of the rings lie above the straight line through their block of
/// 32 lasers [deg]; means over ten recordings of KITTI raw and KITTI odometry.
constexpr std::array<double, 2 * rings_of_block> beam_unevenness_deg{
    0.11,  0.07,  0.14,  0.01,  0.06,  -0.02, 0.05,  0.0,   -0.01, -0.09, -0.04, -0.05, -0.09,
    -0.08, -0.07, -0.08, -0.04, -0.08, -0.02, -0.05, -0.02, -0.02, -0.01, 0.0,   -0.03, -0.01,
    0.02,  0.08,  0.04,  0.02,  0.12,  0.09,  -0.1,  -0.12, -0.09, 0.02,  0.05,  -0.06, -0.06,
    0.01,  0.05,  0.12,  0.09,  0.06,  -0.02, 0.04,  0.04,  0.16,  0.04,  0.01,  -0.06, -0.02,
    -0.03, 0.05,  0.1,   0.04,  0.03,  -0.1,  -0.07, 0.0,   0.06,  -0.08, -0.06, -0.08};
/// Correlation with it: 0.83 and more in scans of these recordings, below 0 in simulated ones.
constexpr double min_correlation = 0.6;
/// Mean elevation of the lower block [rad]: -15.85 to -15.99 degrees in most of 108 scans of all
/// days of these recordings, 0.205 higher where somebody turned them up before.
constexpr double min_corrected_elevation = -15.82 * rad_per_deg;
/// Larger steps are those to the next ring.
constexpr double max_step = 10.0 * rad_per_deg;
/// Simulated lidars turn more evenly than this; KITTI's deviates by 0.09 degrees and more.
constexpr double min_real_step = 0.02 * rad_per_deg;
/// Raw scans show up to 0.014 m, compensated ones 0.07 m at 3 km/h.
constexpr double max_uncompensated_m = 0.04;

double azimuth(const Eigen::Vector3f& p) {
  return std::atan2(static_cast<double>(p.y()), static_cast<double>(p.x()));
}

double distance(const Eigen::Vector3f& p) { return std::hypot(p.x(), p.y()); }

struct Weighted {
  double value;
  double weight;
};

double weighted_median(std::vector<Weighted>& values) {
  std::ranges::sort(values, {}, &Weighted::value);
  double total = 0.0, sum = 0.0;
  for (const Weighted& v : values) total += v.weight;
  for (const Weighted& v : values) {
    sum += v.weight;
    if (2.0 * sum >= total) return v.value;
  }
  return 0.0;
}

/// Takes the best straight line away.
void subtract_line(std::span<double> values) {
  const double n = static_cast<double>(values.size());
  double mean = 0.0, slope = 0.0, squares = 0.0;
  for (const double v : values) mean += v / n;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double x = static_cast<double>(i) - 0.5 * (n - 1.0);
    slope += x * values[i];
    squares += x * x;
  }
  for (std::size_t i = 0; i < values.size(); ++i)
    values[i] -= mean + slope / squares * (static_cast<double>(i) - 0.5 * (n - 1.0));
}

/// Median elevation of each of 64 rings [rad]; nothing for scans that are stored otherwise.
std::optional<std::vector<double>> ring_elevations(const Scan& scan,
                                                   std::span<const std::uint16_t> rings) {
  if (rings.empty()) return std::nullopt;
  std::vector<std::vector<double>> of_ring(beam_unevenness_deg.size());
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const double elevation = measured_elevation(scan.points_lidar[i]);
    if (std::isfinite(elevation)) of_ring.at(rings[i]).push_back(elevation);
  }
  std::vector<double> elevations;
  for (std::vector<double>& values : of_ring) {
    if (values.empty()) return std::nullopt;
    elevations.push_back(median_of(values));
  }
  return elevations;
}

double mean_of_lower_block(std::span<const double> elevations) {
  const auto lower = elevations.last(rings_of_block);
  return std::accumulate(lower.begin(), lower.end(), 0.0) / static_cast<double>(rings_of_block);
}

double correlation_with_kitti(std::vector<double> elevations) {
  const std::span all(elevations);
  subtract_line(all.first(rings_of_block));
  subtract_line(all.last(rings_of_block));
  double product = 0.0, squares = 0.0, squares_known = 0.0;
  for (std::size_t k = 0; k < elevations.size(); ++k) {
    product += elevations[k] * beam_unevenness_deg[k];
    squares += elevations[k] * elevations[k];
    squares_known += beam_unevenness_deg[k] * beam_unevenness_deg[k];
  }
  return squares > 0.0 ? product / std::sqrt(squares * squares_known) : 0.0;
}

}  // namespace

void KittiLidar::correct(Scan& scan) const {
  turn_up(scan, elevation_offset);
  if (sweep_duration_s <= 0.0) return;
  scan.time_offset_s.clear();
  scan.time_offset_s.reserve(scan.size());
  for (const Eigen::Vector3f& p : scan.points_lidar) {
    const double turns = azimuth(p) / (2.0 * std::numbers::pi);
    scan.time_offset_s.push_back(static_cast<float>(-turns * sweep_duration_s));
  }
}

std::string KittiLidar::in_words() const {
  const std::string times = sweep_duration_s > 0.0
                                ? ", and timed by their azimuth: these scans are not compensated"
                                : "; these scans are compensated for the motion";
  return "files of KITTI's lidar: points are turned up by 0.205 degrees" + times;
}

std::optional<AzimuthSteps> azimuth_steps(const Scan& scan) {
  constexpr double max_smooth_per_m = 0.002;
  constexpr double min_jump_per_m = 0.03;
  constexpr std::size_t min_jumps = 100;
  struct Jump {
    double step;
    /// Step that compensation for one metre a sweep adds, straight ahead [rad/m].
    double step_per_m;
  };
  std::vector<double> smooth;
  std::vector<Jump> jumps;
  for (std::size_t i = 1; i < scan.size(); ++i) {
    const Eigen::Vector3f &a = scan.points_lidar[i - 1], &b = scan.points_lidar[i];
    const double azimuth_b = azimuth(b);
    const double step = std::remainder(azimuth_b - azimuth(a), 2.0 * std::numbers::pi);
    const double nearer_per_m = 1.0 / distance(b) - 1.0 / distance(a);
    if (!a.allFinite() || !b.allFinite() || !std::isfinite(nearer_per_m)) continue;
    if (std::abs(step) > max_step) continue;
    if (std::abs(nearer_per_m) < max_smooth_per_m) smooth.push_back(step);
    const double sideways = azimuth_b * std::sin(azimuth_b) / (2.0 * std::numbers::pi);
    if (std::abs(nearer_per_m) > min_jump_per_m) jumps.push_back({step, nearer_per_m * sideways});
  }
  if (jumps.size() < min_jumps || smooth.size() < min_jumps) return std::nullopt;
  const double usual = median_of(smooth);
  std::vector<double> deviations;
  std::vector<Weighted> metres;
  for (const Jump& jump : jumps) {
    deviations.push_back(std::abs(jump.step - usual));
    if (std::abs(jump.step_per_m) > 0.1 * min_jump_per_m)
      metres.push_back({(jump.step - usual) / jump.step_per_m, std::abs(jump.step_per_m)});
  }
  return AzimuthSteps{.deviation_at_jumps = median_of(deviations),
                      .compensated_m = weighted_median(metres)};
}

std::optional<KittiLidar> recognise_kitti_lidar(std::span<const Scan> scans, double period_s,
                                                bool may_be_corrected) {
  const SensorModel sensor = hdl_64e();
  std::vector<double> correlations, lower_elevations, deviations, compensated_m;
  for (const Scan& scan : scans) {
    const auto elevations = ring_elevations(scan, rings_from_order(scan, sensor));
    if (!elevations) continue;
    correlations.push_back(correlation_with_kitti(*elevations));
    lower_elevations.push_back(mean_of_lower_block(*elevations));
    const auto steps = azimuth_steps(scan);
    if (!steps) continue;
    deviations.push_back(steps->deviation_at_jumps);
    compensated_m.push_back(std::abs(steps->compensated_m));
  }
  if (deviations.empty() || median_of(correlations) < min_correlation ||
      median_of(deviations) < min_real_step)
    return std::nullopt;
  if (may_be_corrected && median_of(lower_elevations) > min_corrected_elevation)
    return std::nullopt;
  // Where the car stands nothing shows whether scans are compensated: the upper quartile decides.
  std::ranges::sort(compensated_m);
  const bool is_raw = compensated_m[3 * (compensated_m.size() - 1) / 4] < max_uncompensated_m;
  return KittiLidar{.sweep_duration_s = is_raw ? period_s : 0.0};
}

}  // namespace stillmap
