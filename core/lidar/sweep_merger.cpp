#include "core/lidar/sweep_merger.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace stillmap {
namespace {

/// Beams of tilted lidars, and of lidars beside the middle, leave their own field of view.
constexpr double fov_margin_rad = 2.0 * std::numbers::pi / 180.0;
/// Near enough that the places of lidars count, far enough that they do not blow the view up.
constexpr double near_range_m = 5.0;
constexpr int max_rows = 128;

double seconds(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }

double elevation_of(const Eigen::Vector3d& p) {
  return std::atan2(p.z(), std::hypot(p.x(), p.y()));
}

/// Widens `view` by what the sensor sees.
void widen(SensorModel& view, const PlacedSensor& placed) {
  for (const double elevation : {placed.sensor.fov_up, placed.sensor.fov_down}) {
    for (int degree = 0; degree < 360; degree += 5) {
      const double azimuth = degree * std::numbers::pi / 180.0;
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      for (const double range_m : {near_range_m, placed.sensor.max_range_m}) {
        const double seen = elevation_of(placed.T_merged_lidar * (range_m * ray));
        view.fov_up = std::max(view.fov_up, seen);
        view.fov_down = std::min(view.fov_down, seen);
      }
    }
  }
}

template <typename T>
void append(std::vector<T>& all, const std::vector<T>& part, std::size_t points, const T& unknown) {
  if (part.empty()) {
    all.resize(all.size() + points, unknown);
  } else {
    all.insert(all.end(), part.begin(), part.end());
  }
}

/// Of all points whose intensity is known; nothing without any.
std::optional<float> mean_intensity(std::span<const Scan> parts) {
  double sum = 0.0;
  std::size_t known = 0;
  for (const Scan& part : parts) {
    for (const float intensity : part.intensity) {
      if (!std::isfinite(intensity)) continue;
      sum += intensity;
      ++known;
    }
  }
  if (known > 0) return static_cast<float>(sum / static_cast<double>(known));
  const bool is_there =
      std::ranges::any_of(parts, [](const Scan& part) { return !part.intensity.empty(); });
  return is_there ? std::make_optional(0.0F) : std::nullopt;
}

bool is_labelled(const Scan& scan) { return has_known_class(scan.labels); }

/// Whether one brings labels, and another one points of a lidar that sends none.
bool are_partly_labelled(std::span<const Scan> parts, const std::vector<bool>& sends_labels) {
  bool is_any_unlabelled = false;
  for (std::size_t i = 0; i < parts.size(); ++i)
    is_any_unlabelled |= !parts[i].empty() && !is_labelled(parts[i]) && !sends_labels[i];
  return is_any_unlabelled && std::ranges::any_of(parts, is_labelled);
}

}  // namespace

Eigen::Isometry3d merged_frame(std::span<const Eigen::Isometry3d> T_base_lidars) {
  assert(!T_base_lidars.empty());
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Isometry3d& T_base_lidar : T_base_lidars) sum += T_base_lidar.translation();
  return Eigen::Isometry3d(Eigen::Translation3d(sum / static_cast<double>(T_base_lidars.size())));
}

SensorModel merged_sensor(std::span<const PlacedSensor> sensors) {
  assert(!sensors.empty());
  SensorModel merged = sensors.front().sensor;
  merged.name.clear();
  merged.rings = 0;
  merged.beam_elevations.clear();
  merged.pattern = ScanPattern::merged;
  merged.ring_source = RingSource::elevation;
  merged.intensity_scale = 1.0F;
  merged.elevation_offset = 0.0;
  merged.fov_up = -std::numbers::pi / 2.0;
  merged.fov_down = std::numbers::pi / 2.0;
  merged.imu.reset();
  for (const PlacedSensor& placed : sensors) {
    if (placed.sensor.imu && !merged.imu) {
      merged.imu = placed.sensor.imu;
      merged.imu->R_lidar_imu = placed.T_merged_lidar.linear() * merged.imu->R_lidar_imu;
    }
    const SensorModel& sensor = placed.sensor;
    const double offset_m = placed.T_merged_lidar.translation().norm();
    merged.name += (merged.name.empty() ? "" : " + ") + sensor.name;
    merged.rings += sensor.rings;
    merged.columns = std::max(merged.columns, sensor.columns);
    merged.min_range_m = std::min(merged.min_range_m, sensor.min_range_m);
    merged.max_range_m = std::max(merged.max_range_m, sensor.max_range_m + offset_m);
    merged.period_s = std::max(merged.period_s, sensor.period_s);
    widen(merged, placed);
  }
  merged.rings = std::min(merged.rings, max_rows);
  merged.fov_up = std::min(merged.fov_up + fov_margin_rad, std::numbers::pi / 2.0);
  merged.fov_down = std::max(merged.fov_down - fov_margin_rad, -std::numbers::pi / 2.0);
  return merged;
}

void move_points(Scan& scan, const Eigen::Isometry3d& T_new_old) {
  const Eigen::Isometry3f T = T_new_old.cast<float>();
  for (Eigen::Vector3f& point : scan.points_lidar) point = T * point;
}

Scan merged_scan(std::vector<Scan> parts, PartialLabels partial_labels) {
  const std::vector<bool> sends_labels(parts.size(), false);
  return merged_scan(std::move(parts), sends_labels, partial_labels);
}

Scan merged_scan(std::vector<Scan> parts, const std::vector<bool>& sends_labels,
                 PartialLabels partial_labels) {
  assert(sends_labels.size() == parts.size());
  Scan merged;
  if (parts.empty()) return merged;
  merged.stamp_ns = std::ranges::min(parts, {}, &Scan::stamp_ns).stamp_ns;
  const bool has_times = std::ranges::any_of(parts, [&](const Scan& part) {
    return part.stamp_ns != merged.stamp_ns || !part.time_offset_s.empty();
  });
  const std::optional<float> usual_intensity = mean_intensity(parts);
  const bool has_labels =
      std::ranges::any_of(parts, is_labelled) &&
      (partial_labels == PartialLabels::keep || !are_partly_labelled(parts, sends_labels));
  for (Scan& part : parts) {
    const auto later_s = static_cast<float>(seconds(part.stamp_ns - merged.stamp_ns));
    for (float& time_s : part.time_offset_s) time_s += later_s;
    const std::size_t points = part.size();
    merged.points_lidar.insert(merged.points_lidar.end(), part.points_lidar.begin(),
                               part.points_lidar.end());
    if (has_times) append(merged.time_offset_s, part.time_offset_s, points, later_s);
    if (usual_intensity) append(merged.intensity, part.intensity, points, *usual_intensity);
    if (has_labels) append(merged.labels, part.labels, points, SemanticClass::unlabeled);
  }
  return merged;
}

SweepMerger::SweepMerger(const Config& config)
    : config_(config),
      lidars_(config.lidars),
      is_silent_(config.lidars, false),
      sends_labels_(config.lidars, false),
      rhythms_(config.lidars) {}

std::size_t SweepMerger::add(std::size_t lidar, Scan scan, double now_s) {
  is_silent_[lidar] = false;
  const bool has_points_alone = !scan.empty() && scan.labels.empty();
  if (is_labelled(scan) || has_points_alone) sends_labels_[lidar] = !has_points_alone;
  Rhythm& rhythm = rhythms_[lidar];
  rhythm = {.newest_ns = scan.stamp_ns,
            .step_ns = rhythm.newest_ns ? scan.stamp_ns - *rhythm.newest_ns : 0,
            .step_before_ns = rhythm.step_ns,
            .arrived_s = now_s};
  const bool is_late = last_stamp_ns_ && scan.stamp_ns <= *last_stamp_ns_ &&
                       seconds(*last_stamp_ns_ - scan.stamp_ns) < max_late_s;
  if (is_late) return 1;
  std::deque<Waiting>& waiting = lidars_[lidar];
  waiting.push_back({std::move(scan), now_s});
  if (waiting.size() <= max_waiting) return 0;
  waiting.pop_front();
  return 1;
}

std::optional<std::size_t> SweepMerger::earliest() const {
  std::optional<std::size_t> first;
  for (std::size_t lidar = 0; lidar < lidars_.size(); ++lidar) {
    if (lidars_[lidar].empty()) continue;
    const auto stamp_ns = [&](std::size_t i) { return lidars_[i].front().scan.stamp_ns; };
    if (!first || stamp_ns(lidar) < stamp_ns(*first)) first = lidar;
  }
  return first;
}

bool SweepMerger::is_in_sweep(std::size_t lidar, std::int64_t stamp_ns) const {
  if (lidars_[lidar].empty()) return false;
  return seconds(lidars_[lidar].front().scan.stamp_ns - stamp_ns) < 0.5 * config_.period_s;
}

bool SweepMerger::is_due(const Rhythm& rhythm, std::int64_t stamp_ns) const {
  if (!rhythm.newest_ns) return true;
  const std::int64_t step_ns = std::min(rhythm.step_ns, rhythm.step_before_ns);
  // Nothing that goes on so slowly is a rhythm.
  if (step_ns <= 0 || seconds(step_ns) > 2.5 * config_.period_s) return true;
  const double ahead_s = seconds(*rhythm.newest_ns + step_ns - stamp_ns);
  return ahead_s < 0.5 * config_.period_s || ahead_s > max_late_s;
}

bool SweepMerger::may_come(std::size_t lidar, std::int64_t stamp_ns) const {
  return lidars_[lidar].empty() && !is_silent_[lidar] && is_due(rhythms_[lidar], stamp_ns);
}

bool SweepMerger::waits_for(std::size_t lidar, const Waiting& reference, double now_s) const {
  const std::int64_t stamp_ns = reference.scan.stamp_ns;
  if (!may_come(lidar, stamp_ns)) return false;
  if (now_s - reference.arrived_s < config_.max_wait_s) return true;
  const bool is_far_ahead = last_stamp_ns_ && seconds(stamp_ns - *last_stamp_ns_) > max_late_s;
  const Rhythm& rhythm = rhythms_[lidar];
  return is_far_ahead && rhythm.newest_ns && now_s - rhythm.arrived_s < max_pause_s;
}

std::optional<SweepMerger::Sweep> SweepMerger::next(double now_s) {
  const auto first = earliest();
  if (!first) return std::nullopt;
  const Waiting& reference = lidars_[*first].front();
  const std::int64_t stamp_ns = reference.scan.stamp_ns;
  for (std::size_t lidar = 0; lidar < lidars_.size(); ++lidar)
    if (waits_for(lidar, reference, now_s)) return std::nullopt;
  std::vector<Scan> parts;
  std::vector<bool> sends_labels;
  Sweep sweep;
  for (std::size_t lidar = 0; lidar < lidars_.size(); ++lidar) {
    if (is_in_sweep(lidar, stamp_ns)) {
      parts.push_back(std::move(lidars_[lidar].front().scan));
      sends_labels.push_back(sends_labels_[lidar]);
      lidars_[lidar].pop_front();
      continue;
    }
    const bool came_not = may_come(lidar, stamp_ns);
    const bool is_missing = came_not || is_silent_[lidar] || !lidars_[lidar].empty();
    if (came_not) is_silent_[lidar] = true;
    if (is_missing) sweep.missing.push_back(lidar);
  }
  last_stamp_ns_ = stamp_ns;
  sweep.is_partly_labelled = are_partly_labelled(parts, sends_labels);
  sweep.scan = merged_scan(std::move(parts), sends_labels, config_.partial_labels);
  return sweep;
}

}  // namespace stillmap
