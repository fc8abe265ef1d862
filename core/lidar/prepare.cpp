#include "core/lidar/prepare.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

/// Points whose time lies more periods than this from the stamp have a wrong time and are not
/// moved.
constexpr double max_periods = 2.0;
/// Of a sweep, wherever the stamp is: from the median of its times.
constexpr double max_periods_from_median = 1.25;
/// A shorter sweep shows nothing of the motion within it: a car moves by less than its points are
/// precise.
constexpr double min_sweep_s = 0.002;
constexpr std::size_t median_samples = 1000;

class Usable {
 public:
  explicit Usable(const PrepareConfig& config)
      : min_squared_(static_cast<float>(config.min_range_m * config.min_range_m)),
        max_squared_(static_cast<float>(config.max_range_m * config.max_range_m)),
        ego_hull_lidar_(config.ego_hull_lidar.cast<float>()),
        has_ego_hull_(!ego_hull_lidar_.isEmpty()) {}

  /// 1 for each of the points that is, else 0.
  void operator()(std::span<const Eigen::Vector3f> points_lidar,
                  std::span<std::uint8_t> is_usable) const {
    for (std::size_t k = 0; k < points_lidar.size(); ++k) {
      const float squared = points_lidar[k].squaredNorm();
      // Written so that NaN fails, and infinity whatever max_range_m is.
      constexpr float most = std::numeric_limits<float>::max();
      is_usable[k] =
          (squared >= min_squared_) & (squared <= max_squared_) & (squared <= most) ? 1 : 0;
    }
    if (!has_ego_hull_) return;
    for (std::size_t k = 0; k < points_lidar.size(); ++k)
      if (ego_hull_lidar_.contains(points_lidar[k])) is_usable[k] = 0;
  }

 private:
  float min_squared_;
  float max_squared_;
  Eigen::AlignedBox3f ego_hull_lidar_;
  bool has_ego_hull_;
};

float repaired_intensity(float intensity) {
  return std::isfinite(intensity) ? std::clamp(intensity, 0.0F, 1.0F) : 0.0F;
}

/// So many points are moved at once, in vector registers.
constexpr std::size_t lanes = 32;
using Lanes = Eigen::Array<float, static_cast<int>(lanes), 1>;
using DoubleLanes = Eigen::Array<double, static_cast<int>(lanes), 1>;

/// Of angles up to an eighth of a turn, to 1e-9 of themselves: a float does not show it.
Lanes sine_by_series(const DoubleLanes& angle) {
  const DoubleLanes s = angle * angle;
  return (angle *
          (1.0 + s * (-1.0 / 6.0 +
                      s * (1.0 / 120.0 +
                           s * (-1.0 / 5040.0 + s * (1.0 / 362880.0 - s * (1.0 / 39916800.0)))))))
      .cast<float>();
}
Lanes cosine_by_series(const DoubleLanes& angle) {
  const DoubleLanes s = angle * angle;
  return (1.0 + s * (-0.5 + s * (1.0 / 24.0 +
                                 s * (-1.0 / 720.0 + s * (1.0 / 40320.0 - s * (1.0 / 3628800.0))))))
      .cast<float>();
}

/// Steady motion along a screw: exp(s log(T)) for many s, with the constant parts worked out once.
class ScrewMotion {
 public:
  explicit ScrewMotion(const Eigen::Isometry3d& T) {
    const Eigen::AngleAxisd rotation(T.rotation());
    const double half = 0.5 * rotation.angle();
    angle_ = static_cast<float>(rotation.angle());
    straight_ = std::abs(half) < small_angle;
    const Eigen::Vector3d axis = rotation.axis();
    const Eigen::Vector3d t = T.translation();
    const Eigen::Vector3d along = axis * axis.dot(t);
    const Eigen::Vector3d across = t - along;
    axis_ = axis.cast<float>();
    along_ = along.cast<float>();
    // V^-1 of SE(3)'s exponential map, on the part across the axis; its limit for small angles.
    const double cotangent = straight_ ? 1.0 : half / std::tan(half);
    const Eigen::Vector3d velocity = cotangent * across - half * axis.cross(across);
    across_ = velocity.cast<float>();
    sideways_ = axis.cross(velocity).cast<float>();
  }

  /// exp(s log(T)) p.
  [[nodiscard]] Eigen::Vector3f move(const Eigen::Vector3f& p, double s) const {
    const auto part = static_cast<float>(s);
    const float half_angle = 0.5F * part * angle_;
    const float half_sine = std::sin(half_angle);
    const float sine = 2.0F * half_sine * std::cos(half_angle);
    // 1 - cos(angle), without its loss of digits at small angles.
    const float versine = 2.0F * half_sine * half_sine;
    const float forward = straight_ ? part : sine / angle_;
    const float aside = straight_ ? 0.0F : versine / angle_;
    const Eigen::Vector3f turned = axis_.cross(p);
    return p + sine * turned + versine * axis_.cross(turned) + part * along_ + forward * across_ +
           aside * sideways_;
  }

  /// The same for at most `lanes` points, -0.5 <= s <= 0.5: no rotation is more than half a turn.
  void move(std::span<Eigen::Vector3f> points, std::span<const double> parts) const {
    Lanes x = Lanes::Zero(), y = Lanes::Zero(), z = Lanes::Zero(), part = Lanes::Zero();
    for (std::size_t k = 0; k < points.size(); ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      x[lane] = points[k].x();
      y[lane] = points[k].y();
      z[lane] = points[k].z();
      part[lane] = static_cast<float>(parts[k]);
    }
    const DoubleLanes half_angle = (0.5F * part * angle_).cast<double>();
    const Lanes half_sine = sine_by_series(half_angle);
    const Lanes sine = 2.0F * half_sine * cosine_by_series(half_angle);
    const Lanes versine = 2.0F * half_sine * half_sine;
    const Lanes forward = straight_ ? part : Lanes(sine / angle_);
    const Lanes aside = straight_ ? Lanes(Lanes::Zero()) : Lanes(versine / angle_);
    const Lanes turned_x = axis_.y() * z - axis_.z() * y;
    const Lanes turned_y = axis_.z() * x - axis_.x() * z;
    const Lanes turned_z = axis_.x() * y - axis_.y() * x;
    const auto moved = [&](int axis, const Lanes& p, const Lanes& turned, const Lanes& inwards) {
      return Lanes(p + sine * turned + versine * inwards + part * along_[axis] +
                   forward * across_[axis] + aside * sideways_[axis]);
    };
    const Lanes to_x = moved(0, x, turned_x, axis_.y() * turned_z - axis_.z() * turned_y);
    const Lanes to_y = moved(1, y, turned_y, axis_.z() * turned_x - axis_.x() * turned_z);
    const Lanes to_z = moved(2, z, turned_z, axis_.x() * turned_y - axis_.y() * turned_x);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      points[k] = {to_x[lane], to_y[lane], to_z[lane]};
    }
  }

 private:
  static constexpr double small_angle = 1e-9;

  float angle_ = 0.0F;
  bool straight_ = false;
  Eigen::Vector3f axis_, along_, across_, sideways_;
};

}  // namespace

std::vector<std::uint32_t> usable_points(const Scan& scan, const PrepareConfig& config) {
  const Usable usable(config);
  std::array<std::uint8_t, lanes> is_usable;
  std::vector<std::uint32_t> indices(scan.size());
  std::size_t count = 0;
  for (std::size_t first = 0; first < scan.size(); first += lanes) {
    const auto points =
        std::span(scan.points_lidar).subspan(first, std::min(lanes, scan.size() - first));
    usable(points, is_usable);
    for (std::size_t k = 0; k < points.size(); ++k) {
      indices[count] = static_cast<std::uint32_t>(first + k);
      count += is_usable[k];
    }
  }
  indices.resize(count);
  return indices;
}

Scan drop_unusable_points(Scan scan, const PrepareConfig& config) {
  const std::vector<std::uint32_t> kept = usable_points(scan, config);
  // Up to the first point that is dropped all stay where they are.
  std::size_t first_moved = 0;
  while (first_moved < kept.size() && kept[first_moved] == first_moved) ++first_moved;
  const auto keep = [&](auto& values) {
    if (values.empty()) return;
    for (std::size_t i = first_moved; i < kept.size(); ++i) values[i] = values[kept[i]];
    values.resize(kept.size());
  };
  keep(scan.points_lidar);
  keep(scan.intensity);
  keep(scan.time_offset_s);
  keep(scan.ring);
  keep(scan.labels);
  std::ranges::transform(scan.intensity, scan.intensity.begin(), repaired_intensity);
  return scan;
}

void turn_up(Scan& scan, double angle_rad) {
  if (angle_rad == 0.0) return;
  const auto up = static_cast<float>(std::sin(angle_rad));
  const auto along = static_cast<float>(std::cos(angle_rad));
  for (Eigen::Vector3f& p : scan.points_lidar) {
    const float across = std::hypot(p.x(), p.y());
    if (!(across > 0.0F)) continue;
    const float stretch = along - up * p.z() / across;
    p = {p.x() * stretch, p.y() * stretch, p.z() * along + across * up};
  }
}

double SweepTimes::part(float time_offset_s) const {
  if (duration_s <= 0.0) return 0.0;
  const double part = (time_offset_s - middle_s) / duration_s;
  return std::abs(part) <= 0.5 + 1e-6 ? part : 0.0;
}

namespace {

/// Of some thousand times, spread over the scan; 0 of none.
float median_time_s(const std::vector<float>& times_s) {
  std::vector<float> sample;
  const std::size_t step = times_s.size() / median_samples + 1;
  for (std::size_t i = 0; i < times_s.size(); i += step)
    if (std::isfinite(times_s[i])) sample.push_back(times_s[i]);
  return sample.empty() ? 0.0F : median_of(sample);
}

}  // namespace

SweepTimes sweep_times(const Scan& scan, double period_s) {
  double first_s = 0.0;
  double last_s = 0.0;
  bool any = false;
  const float median_s = median_time_s(scan.time_offset_s);
  for (const float t : scan.time_offset_s) {
    if (!(std::abs(t - median_s) <= max_periods_from_median * period_s)) continue;
    first_s = any ? std::min<double>(first_s, t) : t;
    last_s = any ? std::max<double>(last_s, t) : t;
    any = true;
  }
  const double duration_s = last_s - first_s;
  return {.middle_s = 0.5 * (first_s + last_s),
          .duration_s = duration_s >= min_sweep_s ? duration_s : 0.0};
}

void deskew_to_middle(Scan& scan, const SweepTimes& sweep, const Eigen::Isometry3d& T_start_end) {
  if (sweep.duration_s <= 0.0) return;
  const ScrewMotion motion(T_start_end);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 4096), [&](const auto& range) {
    std::array<double, lanes> parts;
    for (std::size_t i = range.begin(); i < range.end(); i += lanes) {
      const std::size_t count = std::min(lanes, range.end() - i);
      for (std::size_t k = 0; k < count; ++k) parts[k] = sweep.part(scan.time_offset_s[i + k]);
      motion.move(std::span(scan.points_lidar).subspan(i, count), std::span(parts).first(count));
    }
  });
}

Scan deskew(Scan scan, const Eigen::Isometry3d& T_start_end, double period_s) {
  assert(period_s > 0.0);
  if (scan.time_offset_s.empty()) return scan;
  assert(scan.time_offset_s.size() == scan.size());
  const ScrewMotion motion(T_start_end);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 4096), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const double periods = scan.time_offset_s[i] / period_s;
      if (!(std::abs(periods) <= max_periods)) continue;
      scan.points_lidar[i] = motion.move(scan.points_lidar[i], periods);
    }
  });
  scan.time_offset_s.clear();
  return scan;
}

}  // namespace stillmap
