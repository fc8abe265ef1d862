#include "core/lidar/point_fields.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

constexpr double max_offset_s = 10.0;
/// A stamp that is farther from its points' times than this is of another clock [s]: the pose at
/// the stamp is told from the sweep's own motion.
constexpr double max_from_stamp_s = 1.0;
/// Outside these durations another unit is tried.
constexpr double min_scan_s = 1e-3;
constexpr double max_scan_s = 5.0;
/// The shortest revolution for which another unit is taken.
constexpr double min_revolution_s = 5e-3;
/// Absolute times lie between 1990 and 2100, in any unit.
constexpr double min_epoch_s = 6.3e8;
constexpr double max_epoch_s = 4.1e9;
/// Points that are looked at to find out what the numbers of all mean.
constexpr std::size_t max_time_samples = 4096;
constexpr std::size_t max_intensity_samples = 8192;
/// Intensities may exceed their full scale by this factor.
constexpr float overshoot = 1.5F;
/// So many scans in a row are no broken ones.
constexpr int proof_of_full_scale = 5;

struct Unit {
  const char* name;
  double seconds;
};
constexpr std::array<Unit, 4> units = {{{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}}};

/// Up to some thousand finite times, spread over the scan. Zeros, which also stand for points that
/// were not measured, are left out unless there is nothing else.
std::vector<double> sample_of(std::span<const double> times) {
  std::vector<double> sample;
  bool zeros = false;
  const std::size_t step = times.size() / max_time_samples + 1;
  for (std::size_t i = 0; i < times.size(); i += step) {
    if (times[i] == 0.0) zeros = true;
    if (std::isfinite(times[i]) && times[i] != 0.0) sample.push_back(times[i]);
  }
  if (sample.empty() && zeros) sample.push_back(0.0);
  return sample;
}

/// Times of a counter of 32 bits that began anew within the scan, as if it had gone on. Nothing of
/// a counter that did not.
std::vector<double> unwrapped(std::span<const double> times) {
  constexpr double full_turn = 4294967296.0;
  // All points are that near one of the counter's ends.
  constexpr double max_from_end = full_turn / 8.0;
  // Fewer before it began anew are broken ones.
  constexpr std::size_t min_share_before = 20;
  std::size_t before = 0;
  std::size_t after = 0;
  for (const double t : times) {
    if (!std::isfinite(t) || t == 0.0) continue;
    const bool is_before = t >= full_turn - max_from_end && t < full_turn;
    const bool is_after = t > 0.0 && t < max_from_end;
    if (!is_before && !is_after) return {};
    (is_before ? before : after) += 1;
  }
  if (after == 0 || before * min_share_before < times.size()) return {};
  std::vector<double> going_on(times.begin(), times.end());
  for (double& t : going_on) t += t < max_from_end ? full_turn : 0.0;
  return going_on;
}

/// From the 5th to the 95th percentile, so that a few broken times do not count; in the unit of the
/// times.
double span_of(std::vector<double>& values) {
  const double low = ranked_value(values, values.size() * 5 / 100);
  return ranked_value(values, values.size() * 95 / 100) - low;
}

/// The unit that makes a double a time between 1990 and 2100.
std::optional<Unit> unit_by_magnitude(double middle, double span) {
  for (const Unit& unit : units) {
    const double middle_s = std::abs(middle) * unit.seconds;
    const bool plausible = middle_s >= min_epoch_s && middle_s <= max_epoch_s;
    if (plausible && span * unit.seconds <= max_scan_s) return unit;
  }
  return std::nullopt;
}

Unit unit_of(double middle, double span, TimeType type) {
  const Unit& usual = type == TimeType::integer ? units[3] : units[0];
  if (type == TimeType::float64) {
    if (const auto unit = unit_by_magnitude(middle, span)) return *unit;
  }
  const double usual_span_s = span * usual.seconds;
  if (span == 0.0 || (usual_span_s >= min_scan_s && usual_span_s <= max_scan_s)) {
    return usual;
  }
  for (const Unit& unit : units) {
    const double span_s = span * unit.seconds;
    if (span_s >= min_revolution_s && span_s < max_scan_s) return unit;
  }
  return usual;
}

/// Offsets from `reference`, not finite where a time lies too far from `middle`.
std::vector<float> offsets_from(double reference, double middle, std::span<const double> times_s) {
  std::vector<float> offsets;
  offsets.reserve(times_s.size());
  for (const double t : times_s) {
    const bool near = std::abs(t - middle) <= max_offset_s;
    offsets.push_back(near ? static_cast<float>(t - reference) : NAN);
  }
  return offsets;
}

double earliest_near(double middle, std::span<const double> times_s) {
  double earliest = middle;
  for (const double t : times_s) {
    if (middle - t <= max_offset_s) earliest = std::min(earliest, t);
  }
  return earliest;
}

/// Up to some thousand finite values, spread over the scan.
std::vector<float> sample_of(std::span<const float> intensity) {
  std::vector<float> sample;
  const std::size_t step = intensity.size() / max_intensity_samples + 1;
  for (std::size_t i = 0; i < intensity.size(); i += step) {
    if (std::isfinite(intensity[i])) sample.push_back(intensity[i]);
  }
  return sample;
}

/// A percentile that a few bright or broken values do not move; 0 of no values.
float bright_value(std::vector<float>& sample) {
  if (sample.empty()) return 0.0F;
  return ranked_value(sample, sample.size() * 99 / 100);
}

float full_scale_above(float bright) {
  for (const float scale : {1.0F, 255.0F}) {
    if (bright <= overshoot * scale) return scale;
  }
  return 65535.0F;
}

/// Values of 0..1: whole numbers could as well be a dark scan of a sensor that counts to 255.
bool fractions_only(const std::vector<float>& sample) {
  const auto within = [](float value) { return value >= 0.0F && value <= 1.0F; };
  const auto fraction = [](float value) { return value != std::floor(value); };
  return std::ranges::all_of(sample, within) && std::ranges::any_of(sample, fraction);
}

std::string remark(float full_scale) {
  return "intensity reaches " + std::to_string(static_cast<int>(full_scale)) +
         " and not what the sensor's intensity_scale says; it is divided by that";
}

}  // namespace

CoordinateField coordinate_field(const std::string& name) {
  if (name.starts_with('-')) return {name.substr(1), -1.0F};
  return {name, 1.0F};
}

Eigen::Matrix3f axes_by(const PointFieldNames& names) {
  constexpr std::string_view letters = "xyz";
  const std::array lists{&names.x, &names.y, &names.z};
  Eigen::Matrix3f axes = Eigen::Matrix3f::Identity();
  for (int row = 0; row < 3; ++row) {
    for (const std::string& name : *lists[static_cast<std::size_t>(row)]) {
      const auto [field, sign] = coordinate_field(name);
      const auto column = field.size() == 1 ? letters.find(field.front()) : std::string_view::npos;
      if (column == std::string_view::npos) continue;
      axes.row(row).setZero();
      axes(row, static_cast<int>(column)) = sign;
      break;
    }
  }
  return axes;
}

bool are_axes(const Eigen::Matrix3f& axes) { return std::abs(axes.determinant()) == 1.0F; }

Eigen::Isometry3d about_other_axes(const Eigen::Isometry3d& T, const Eigen::Matrix3d& axes) {
  Eigen::Isometry3d other = Eigen::Isometry3d::Identity();
  other.linear() = axes * T.linear() * axes.transpose();
  other.translation() = axes * T.translation();
  return other;
}

std::string axes_in_words(const PointFieldNames& names) {
  const PointFieldNames own;
  if (names.x == own.x && names.y == own.y && names.z == own.z) return {};
  const auto first = [](const std::vector<std::string>& list) {
    return list.empty() ? std::string() : list.front();
  };
  return "x from " + first(names.x) + ", y from " + first(names.y) + ", z from " + first(names.z) +
         ", ";
}

PointTimes point_times(std::span<const double> times, TimeType type, std::int64_t stamp_ns) {
  const std::vector<double> going_on =
      type == TimeType::integer ? unwrapped(times) : std::vector<double>{};
  if (!going_on.empty()) times = going_on;
  std::vector<double> sample = sample_of(times);
  if (sample.empty()) return {{}, "no finite time"};
  const double middle = median_of(sample);
  if (type == TimeType::float32 && std::abs(middle) >= min_epoch_s) {
    return {{}, "times since 1970 do not fit into 32-bit floats"};
  }
  const double span = span_of(sample);
  const Unit unit = unit_of(middle, span, type);
  if (span * unit.seconds > max_scan_s) {
    return {{},
            "times of one scan are " + std::to_string(span) + " apart, in no unit a revolution"};
  }
  std::vector<double> times_s(times.begin(), times.end());
  for (double& t : times_s) t *= unit.seconds;
  const double middle_s = middle * unit.seconds;
  const double stamp_s = static_cast<double>(stamp_ns) * 1e-9;
  const std::string name = unit.name;
  // A simulator's clock begins at 0, and its times are small, too.
  const bool is_clock = std::abs(middle_s - stamp_s) < 0.5 * std::abs(middle_s);
  if (std::abs(middle_s) <= max_from_stamp_s && !is_clock) {
    return {offsets_from(0.0, middle_s, times_s), name + " from the stamp"};
  }
  if (std::abs(middle_s - stamp_s) <= max_from_stamp_s) {
    return {offsets_from(stamp_s, middle_s, times_s), name + " on the stamp's clock"};
  }
  return {offsets_from(earliest_near(middle_s, times_s), middle_s, times_s),
          name + " on another clock than the stamp's, counted from the earliest point"};
}

float intensity_full_scale(std::span<const float> intensity) {
  std::vector<float> sample = sample_of(intensity);
  return full_scale_above(bright_value(sample));
}

std::optional<float> IntensityScale::contradiction(std::vector<float>& sample) const {
  const float bright = bright_value(sample);
  const bool is_too_bright = bright * factor_ > overshoot;
  const bool is_too_dark = is_first_ && factor_ < 1.0F && fractions_only(sample);
  if (!is_too_bright && !is_too_dark) return std::nullopt;
  return full_scale_above(bright);
}

std::string IntensityScale::apply(std::span<float> intensity) {
  std::vector<float> sample = sample_of(intensity);
  if (sample.empty()) return {};
  std::string corrected;
  float factor = factor_;
  if (const auto full_scale = contradiction(sample)) {
    if (*full_scale != shown_full_scale_) {
      scans_in_a_row_ = 0;
      corrected = remark(*full_scale);
    }
    shown_full_scale_ = *full_scale;
    factor = 1.0F / *full_scale;
    if (++scans_in_a_row_ >= proof_of_full_scale) factor_ = factor;
  } else {
    is_first_ = false;
    shown_full_scale_ = 0.0F;
  }
  for (float& value : intensity) value *= factor;
  return corrected;
}

}  // namespace stillmap
