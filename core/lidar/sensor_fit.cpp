#include "core/lidar/sensor_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iomanip>
#include <numbers>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/measured_elevation.hpp"
#include "core/lidar/ranked_value.hpp"
#include "core/lidar/ring_numbering.hpp"
#include "core/lidar/rings.hpp"

namespace stillmap {
namespace {

constexpr std::size_t min_points = 1000;
constexpr std::size_t min_points_on_ring = 10;
/// Beams of one kind of sensor differ by less from its data sheet, apart from mounting and wear.
constexpr double max_elevation_difference = 0.5 * rad_per_deg;
/// Smallest step between the elevations of two rings: beams must descend strictly.
constexpr double min_elevation_step = 0.01 * rad_per_deg;
/// Bands that the field of view of a sensor without rings is divided into: 1 to 2 degrees each.
constexpr int bands = 40;
/// A sensor's points lie inside its field of view but for noise and mounting.
constexpr double margin = 1.0 * rad_per_deg;
constexpr std::size_t max_samples = 8192;

/// Elevations of the measured points of every ring, in the field's own order. Empty for a field of
/// more rings than a sensor can have, which is something else.
std::vector<std::vector<double>> elevations_by_ring(const Scan& scan) {
  constexpr int max_rings = 256;
  const RingNumbering numbering = ring_numbering(scan);
  if (numbering.rings > max_rings) return {};
  std::vector<std::vector<double>> of_ring(static_cast<std::size_t>(numbering.rings));
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const double elevation = measured_elevation(scan.points_lidar[i]);
    if (std::isfinite(elevation)) of_ring[numbering.ring_of(scan.ring[i])].push_back(elevation);
  }
  return of_ring;
}

/// Whether a quarter of the points lie far from the middles of their rings, within sectors of
/// azimuth: the field then names no rings, as that of several lidars that lean, each in its way.
/// Rings of one that leans, or whose cloud is in the robot's frame, bend smoothly; motion within a
/// scan, taken out or not, moves most points by less than a few degrees.
bool are_scattered(const Scan& scan, const std::vector<double>& medians) {
  constexpr double max_distance = 3.0 * rad_per_deg;
  constexpr std::size_t sectors = 12;
  const auto [low, high] = std::ranges::minmax(medians);
  const double step = (high - low) / static_cast<double>(medians.size() - 1);
  const RingNumbering numbering = ring_numbering(scan);
  std::vector<std::vector<double>> pieces(medians.size() * sectors);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const Eigen::Vector3d p = scan.points_lidar[i].cast<double>();
    const double elevation = measured_elevation(scan.points_lidar[i]);
    if (!std::isfinite(elevation)) continue;
    const double turn = 0.5 + std::atan2(p.y(), p.x()) / (2.0 * std::numbers::pi);
    const auto sector = std::min(static_cast<std::size_t>(turn * sectors), sectors - 1);
    pieces[numbering.ring_of(scan.ring[i]) * sectors + sector].push_back(elevation);
  }
  std::size_t points = 0, far = 0;
  for (std::vector<double>& piece : pieces) {
    if (piece.empty()) continue;
    const double middle = median_of(piece);
    points += piece.size();
    far += static_cast<std::size_t>(std::ranges::count_if(piece, [&](double elevation) {
      return std::abs(elevation - middle) > std::max(step, max_distance);
    }));
  }
  return 4 * far > points;
}

/// Interpolates or extrapolates the elevations of rings without points; false with fewer than two.
bool complete(std::vector<double>& elevations) {
  const std::ptrdiff_t known = std::ranges::count_if(elevations, [](double e) { return e == e; });
  if (known < 2) return false;
  std::vector<std::size_t> seen;
  for (std::size_t i = 0; i < elevations.size(); ++i) {
    if (std::isfinite(elevations[i])) seen.push_back(i);
  }
  for (std::size_t i = 0; i < elevations.size(); ++i) {
    if (std::isfinite(elevations[i])) continue;
    const auto after = std::ranges::lower_bound(seen, i);
    const std::size_t b =
        std::clamp<std::size_t>(static_cast<std::size_t>(after - seen.begin()), 1, seen.size() - 1);
    const double low = elevations[seen[b - 1]], high = elevations[seen[b]];
    const auto part = (static_cast<double>(i) - static_cast<double>(seen[b - 1])) /
                      static_cast<double>(seen[b] - seen[b - 1]);
    elevations[i] = low + part * (high - low);
  }
  return true;
}

/// Whether the elevations of a scan, from the highest, are those of the built-in sensor's beams
/// from this one on.
bool are_beams_from(int first, const std::vector<double>& elevations, const SensorModel& sensor) {
  double sum = 0.0;
  for (std::size_t i = 0; i < elevations.size(); ++i) {
    sum += std::abs(elevations[i] - sensor.beam_elevation(first + static_cast<int>(i)));
  }
  return sum / static_cast<double>(elevations.size()) <= max_elevation_difference;
}

/// Whether they are its beams, but for up to a quarter at the edges.
bool is_built_in(const std::vector<double>& elevations, const SensorModel& sensor) {
  const int missing = sensor.rings - static_cast<int>(elevations.size());
  if (missing < 0 || 4 * missing > sensor.rings) return false;
  for (int first = 0; first <= missing; ++first) {
    if (are_beams_from(first, elevations, sensor)) return true;
  }
  return false;
}

std::optional<SensorModel> built_in(const std::vector<double>& elevations) {
  for (SensorModel sensor : {vlp_16(), hdl_32e(), hdl_64e()}) {
    if (is_built_in(elevations, sensor)) return sensor;
  }
  return std::nullopt;
}

SensorModel of_beams(std::vector<double> elevations) {
  for (std::size_t i = 1; i < elevations.size(); ++i) {
    elevations[i] = std::min(elevations[i], elevations[i - 1] - min_elevation_step);
  }
  SensorModel sensor;
  sensor.rings = static_cast<int>(elevations.size());
  sensor.name = std::to_string(sensor.rings) + " rings as seen in the data";
  const double half_step =
      (elevations.front() - elevations.back()) / (2.0 * static_cast<double>(sensor.rings - 1));
  constexpr double quarter_turn = std::numbers::pi / 2.0;
  sensor.fov_up = std::min(elevations.front() + half_step, quarter_turn);
  sensor.fov_down = std::max(elevations.back() - half_step, -quarter_turn);
  sensor.beam_elevations = std::move(elevations);
  sensor.max_range_m = 200.0;
  return sensor;
}

/// `elevations`: from the highest, of a ring each.
std::optional<SensorModel> fit_beams(std::vector<double> elevations) {
  if (auto sensor = built_in(elevations)) return sensor;
  SensorModel sensor = of_beams(std::move(elevations));
  return sensor.faults().empty() ? std::optional(std::move(sensor)) : std::nullopt;
}

std::optional<SensorModel> fit_rings(const Scan& scan) {
  std::vector<std::vector<double>> of_ring = elevations_by_ring(scan);
  std::vector<double> elevations;
  for (std::vector<double>& values : of_ring)
    elevations.push_back(values.size() < min_points_on_ring ? NAN : median_of(values));
  if (elevations.size() < 4 || !complete(elevations)) return std::nullopt;
  if (are_scattered(scan, elevations)) return std::nullopt;
  std::ranges::sort(elevations, std::greater<>{});
  return fit_beams(std::move(elevations));
}

/// Points that lie close together in elevation.
struct Cluster {
  double points = 0.0;
  double sum = 0.0;
  double squares = 0.0;

  [[nodiscard]] double mean() const { return sum / points; }
  [[nodiscard]] double variance() const { return squares / points - mean() * mean(); }
};

/// Clusters of the elevations from the highest, where nothing lies between; `points`: of all.
std::vector<Cluster> elevation_clusters(const Scan& scan, double& points) {
  // Beams start a centimetre beside the origin, which is half a degree here; farther away a lidar
  // low on a robot sees nothing of its lower rings.
  constexpr float min_range_m = 1.0F;
  constexpr double bin = 0.02 * rad_per_deg;
  constexpr std::size_t bins_half = 4500;
  constexpr std::size_t empty_between = 2;
  std::vector<Cluster> histogram(2 * bins_half + 1);
  points = 0.0;
  for (const Eigen::Vector3f& p : scan.points_lidar) {
    const double elevation = measured_elevation(p);
    if (!std::isfinite(elevation) || p.squaredNorm() < min_range_m * min_range_m) continue;
    Cluster& at = histogram[static_cast<std::size_t>(std::lround(elevation / bin) + bins_half)];
    at.points += 1.0;
    at.sum += elevation;
    at.squares += elevation * elevation;
    points += 1.0;
  }
  std::vector<Cluster> clusters;
  std::size_t empty = empty_between;
  for (auto at = histogram.rbegin(); at != histogram.rend(); ++at) {
    if (at->points == 0.0) {
      ++empty;
      continue;
    }
    if (empty >= empty_between) clusters.emplace_back();
    empty = 0;
    clusters.back().points += at->points;
    clusters.back().sum += at->sum;
    clusters.back().squares += at->squares;
  }
  return clusters;
}

/// Elevations of the rings, from the highest, that a scan shows which does not number them: nearly
/// all of its points lie close to them, and few between. Empty where it shows none.
std::vector<double> shown_rings(const Scan& scan) {
  constexpr std::size_t min_rings = 8;
  constexpr double min_share_of_ring = 0.002;
  constexpr double min_share_on_rings = 0.95;
  constexpr double max_deviation_to_step = 0.12;
  double points = 0.0;
  std::vector<Cluster> clusters = elevation_clusters(scan, points);
  std::erase_if(clusters, [&](const Cluster& c) { return c.points < min_share_of_ring * points; });
  if (clusters.size() < min_rings || points < static_cast<double>(min_points)) return {};
  double on_rings = 0.0;
  std::vector<double> elevations;
  for (std::size_t i = 0; i < clusters.size(); ++i) {
    const Cluster& ring = clusters[i];
    double step = std::numbers::pi;
    if (i > 0) step = std::min(step, clusters[i - 1].mean() - ring.mean());
    if (i + 1 < clusters.size()) step = std::min(step, ring.mean() - clusters[i + 1].mean());
    const double max_deviation = max_deviation_to_step * step;
    if (ring.variance() > max_deviation * max_deviation) return {};
    on_rings += ring.points;
    elevations.push_back(ring.mean());
  }
  if (on_rings < min_share_on_rings * points) return {};
  return elevations;
}

/// Of a built-in sensor, the beam nearest to a point's elevation is its ring: where a ring lies
/// between two of them, as that of a simulated lidar of nearly this field of view may, its points
/// would be shared out.
bool are_near_their_beams(const std::vector<double>& elevations, const SensorModel& sensor) {
  constexpr double max_share_of_step = 0.35;
  const double step = (sensor.beam_elevation(0) - sensor.beam_elevation(sensor.rings - 1)) /
                      static_cast<double>(sensor.rings - 1);
  return std::ranges::all_of(elevations, [&](double elevation) {
    double nearest = INFINITY;
    for (int ring = 0; ring < sensor.rings; ++ring)
      nearest = std::min(nearest, std::abs(elevation - sensor.beam_elevation(ring)));
    return nearest < max_share_of_step * step;
  });
}

/// The sensor of rings that a scan shows.
std::optional<SensorModel> fit_shown_rings(std::vector<double> elevations) {
  const std::optional<SensorModel> known = built_in(elevations);
  if (known &&
      (known->ring_source == RingSource::order || are_near_their_beams(elevations, *known)))
    return known;
  SensorModel sensor = of_beams(std::move(elevations));
  return sensor.faults().empty() ? std::optional(std::move(sensor)) : std::nullopt;
}

/// Whether a scan with these highest and lowest elevations may be an HDL-64E's, whose beams differ
/// by half a degree from car to car, and in a compensated scan by more.
bool is_field_of_hdl_64e(double high, double low) {
  return high < 5.0 * rad_per_deg && low < -20.0 * rad_per_deg && low > -27.0 * rad_per_deg;
}

/// Median elevation of each turn, and the share of points that lie nearer to it than half way to
/// the next one. Nothing unless every turn has points and lies below the one before.
struct OrderedRings {
  std::vector<double> elevations;
  double share_near = 0.0;
};

std::optional<OrderedRings> ordered_rings(const Scan& scan, std::span<const std::uint16_t> turns) {
  constexpr std::size_t min_rings = 8, max_rings = 256;
  const std::size_t count = turns.empty() ? 0 : std::size_t{turns.back()} + 1;
  if (count < min_rings || count > max_rings) return std::nullopt;
  std::vector<std::vector<double>> of_ring(count);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const double elevation = measured_elevation(scan.points_lidar[i]);
    if (std::isfinite(elevation)) of_ring[turns[i]].push_back(elevation);
  }
  // A few points beyond the seam open another turn.
  if (of_ring.back().size() < min_points_on_ring) of_ring.pop_back();
  OrderedRings rings;
  std::size_t points = 0, near = 0;
  for (std::vector<double>& values : of_ring) {
    if (values.size() < min_points_on_ring) return std::nullopt;
    const double middle = median_of(values);
    if (!rings.elevations.empty() && middle >= rings.elevations.back() - min_elevation_step)
      return std::nullopt;
    rings.elevations.push_back(middle);
  }
  for (std::size_t k = 0; k < of_ring.size(); ++k) {
    const std::size_t last = of_ring.size() - 1;
    const double step =
        std::min(k > 0 ? rings.elevations[k - 1] - rings.elevations[k] : INFINITY,
                 k < last ? rings.elevations[k] - rings.elevations[k + 1] : INFINITY);
    points += of_ring[k].size();
    near += static_cast<std::size_t>(std::ranges::count_if(of_ring[k], [&](double elevation) {
      return std::abs(elevation - rings.elevations[k]) < 0.5 * step;
    }));
  }
  rings.share_near = static_cast<double>(near) / static_cast<double>(points);
  return rings;
}

/// By rings that a scan stores one after the other, from the highest: those of a lidar whose beams
/// start some centimetres apart, or of a scan that is compensated for its motion, are too wide to
/// be shown.
std::optional<SensorModel> fit_order(const Scan& scan) {
  // Half of them where rings end elsewhere than they are cut.
  constexpr double min_share_near = 0.6;
  std::optional<OrderedRings> best;
  for (const std::vector<std::uint16_t>& turns : turns_in_order(scan)) {
    std::optional<OrderedRings> rings = ordered_rings(scan, turns);
    if (rings && (!best || rings->share_near > best->share_near)) best = std::move(rings);
  }
  if (!best || best->share_near < min_share_near) return std::nullopt;
  const std::vector<double>& elevations = best->elevations;
  const int missing = hdl_64e().rings - static_cast<int>(elevations.size());
  if (missing >= 0 && 4 * missing <= hdl_64e().rings &&
      is_field_of_hdl_64e(elevations.front(), elevations.back()))
    return hdl_64e();
  std::optional<SensorModel> sensor = fit_beams(std::move(best->elevations));
  if (sensor) sensor->ring_source = RingSource::order;
  return sensor;
}

/// Elevations from all over the scan, sorted.
std::vector<double> sorted_elevations(const Scan& scan) {
  std::vector<double> elevations;
  const std::size_t step = scan.size() / max_samples + 1;
  for (std::size_t i = 0; i < scan.size(); i += step) {
    const double elevation = measured_elevation(scan.points_lidar[i]);
    if (std::isfinite(elevation)) elevations.push_back(elevation);
  }
  std::ranges::sort(elevations);
  return elevations;
}

/// The 0.1 % and the 99.9 % quantile: a few broken points do not move them.
std::pair<double, double> edges_of(const std::vector<double>& sorted) {
  const std::size_t cut = sorted.size() / 1000;
  return {sorted[cut], sorted[sorted.size() - 1 - cut]};
}

std::optional<SensorModel> fit_bands(const Scan& scan) {
  const std::vector<double> elevations = sorted_elevations(scan);
  if (elevations.size() < min_points / 2) return std::nullopt;
  const auto [low, high] = edges_of(elevations);
  if (std::abs(high - 15.0 * rad_per_deg) < max_elevation_difference &&
      std::abs(low + 15.0 * rad_per_deg) < max_elevation_difference) {
    return vlp_16();
  }
  if (is_field_of_hdl_64e(high, low)) return hdl_64e();
  if (high - low < 1.0 * rad_per_deg) return std::nullopt;
  SensorModel sensor;
  sensor.name = "lidar without rings";
  sensor.pattern = ScanPattern::irregular;
  sensor.rings = bands;
  sensor.fov_up = high;
  sensor.fov_down = low;
  sensor.max_range_m = 200.0;
  return sensor;
}

std::string in_degrees(double angle) {
  return std::to_string(static_cast<int>(std::lround(angle / rad_per_deg)));
}

}  // namespace

std::optional<SensorModel> fit_sensor(const Scan& scan) {
  if (scan.size() < min_points) return std::nullopt;
  if (!scan.ring.empty()) {
    if (auto sensor = fit_rings(scan)) return sensor;
  }
  if (std::vector<double> rings = shown_rings(scan); !rings.empty())
    return fit_shown_rings(std::move(rings));
  if (auto sensor = fit_order(scan)) return sensor;
  return fit_bands(scan);
}

std::string sensor_mismatch(const Scan& scan, const SensorModel& sensor) {
  const RingNumbering numbering = ring_numbering(scan);
  // The same number in all points tells nothing, nor does a field beside a sensor without rings.
  if (sensor.pattern == ScanPattern::rings && numbering.numbers > 1 &&
      numbering.rings > sensor.rings && !ring_numbering(scan, sensor)) {
    return "the cloud's ring field reaches " + std::to_string(numbering.highest_number()) + " (" +
           std::to_string(numbering.numbers) + " rings), but sensor " + sensor.name + " has only " +
           std::to_string(sensor.rings) + " rings";
  }
  const std::vector<double> elevations = sorted_elevations(scan);
  if (elevations.size() < min_points / 10) return {};
  const auto outside = std::ranges::count_if(elevations, [&](double elevation) {
    return elevation > sensor.fov_up + margin || elevation < sensor.fov_down - margin;
  });
  if (outside * 5 <= std::ssize(elevations)) return {};
  const auto [low, high] = edges_of(elevations);
  return "the cloud's points lie between " + in_degrees(low) + " and " + in_degrees(high) +
         " degrees of elevation, but sensor " + sensor.name + " sees from " +
         in_degrees(sensor.fov_down) + " to " + in_degrees(sensor.fov_up);
}

std::string in_words(const SensorModel& sensor) {
  std::ostringstream text;
  text << sensor.name << ": "
       << (sensor.pattern != ScanPattern::rings ? "points anywhere"
                                                : std::to_string(sensor.rings) + " rings")
       << std::fixed << std::setprecision(2) << " from " << sensor.fov_up / rad_per_deg << " to "
       << sensor.fov_down / rad_per_deg << " degrees of elevation";
  return text.str();
}

bool SensorRecognition::learn(const Scan& scan) {
  // Two lidars on one topic tell it again and again.
  constexpr int max_times_told = 5;
  if (sensor_ && (times_told_ == max_times_told || sensor_mismatch(scan, *sensor_).empty()))
    return false;
  std::optional<SensorModel> told = fit_sensor(scan);
  if (!told) return false;
  if (sensor_) {
    const bool has_bands = told->pattern == ScanPattern::irregular;
    if (told->pattern != sensor_->pattern || (!has_bands && told->rings <= sensor_->rings))
      return false;
    if (has_bands) {
      told->fov_up = std::max(told->fov_up, sensor_->fov_up);
      told->fov_down = std::min(told->fov_down, sensor_->fov_down);
    }
  }
  sensor_ = std::make_shared<const SensorModel>(*std::move(told));
  ++times_told_;
  return true;
}

}  // namespace stillmap
