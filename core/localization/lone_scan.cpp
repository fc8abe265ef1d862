#include "core/localization/lone_scan.hpp"

#include <utility>

#include "core/odometry/sweep_motion.hpp"

namespace stillmap {
namespace {

/// A motion of 0.7 m and 6 degrees a sweep takes five.
constexpr int max_iterations = 8;
/// The last one changes the motion by less [m, rad].
constexpr double steady_m = 0.1;
constexpr double steady_rad = 0.01;
/// Of each half.
constexpr double min_explained = 0.5;
constexpr double min_confirmed = 0.8;

/// What was measured before the middle of the sweep, or after it.
struct HalfOfSweep {
  Scan scan;
  PointLabels labels;
};

HalfOfSweep half_of(const Scan& scan, const PointLabels& labels, const SweepTimes& sweep,
                    bool is_second) {
  HalfOfSweep half;
  half.scan.stamp_ns = scan.stamp_ns;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if ((sweep.part(scan.time_offset_s[i]) > 0.0) != is_second) continue;
    half.scan.points_lidar.push_back(scan.points_lidar[i]);
    if (!scan.ring.empty()) half.scan.ring.push_back(scan.ring[i]);
    if (labels.empty()) continue;
    half.labels.classes.push_back(labels.classes[i]);
    half.labels.confidence.push_back(labels.confidence[i]);
  }
  return half;
}

Scan at_middle(const Scan& scan, const SweepTimes& sweep, const Eigen::Isometry3d& T_start_end) {
  Scan moved = scan;
  SweepMotion(T_start_end).move_to_middle(moved, sweep);
  return moved;
}

/// Half a scan that is where the map has it. Its ground may be too little to tell.
bool is_half_there(const PoseEvidence& evidence) {
  return evidence.explained >= min_explained && evidence.confirmed >= min_confirmed;
}

}  // namespace

const char* name(SweepMotionSource source) {
  switch (source) {
    case SweepMotionSource::no_times:
      return "no times";
    case SweepMotionSource::scans_before:
      return "scans before";
    case SweepMotionSource::map:
      return "map";
    case SweepMotionSource::unknown:
      return "unknown";
  }
  return "unknown";
}

std::optional<Eigen::Isometry3d> sweep_motion_in_map(const Localizer& localizer, const Scan& scan,
                                                     const PointLabels& labels,
                                                     const SweepTimes& sweep,
                                                     const Eigen::Matrix3d& R_body_lidar,
                                                     const Eigen::Isometry3d& T_map_lidar) {
  Eigen::Isometry3d T_start_end = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_map_middle = T_map_lidar;
  for (int k = 0; k < max_iterations; ++k) {
    const Scan moved = at_middle(scan, sweep, T_start_end);
    const auto aligned = [&](bool is_second) {
      const HalfOfSweep half = half_of(moved, labels, sweep, is_second);
      return localizer.align_at(LocalizationQuery(half.scan, half.labels, R_body_lidar),
                                T_map_middle);
    };
    const PlaceHypothesis first = aligned(false);
    const PlaceHypothesis second = aligned(true);
    const Eigen::Isometry3d T_first_second = first.T_map_lidar.inverse() * second.T_map_lidar;
    const Eigen::Isometry3d more = T_first_second * T_first_second;
    T_start_end = T_start_end * more;
    const bool is_steady = more.translation().norm() < steady_m &&
                           Eigen::AngleAxisd(more.linear()).angle() < steady_rad;
    if (is_steady && is_half_there(first.evidence) && is_half_there(second.evidence))
      return T_start_end;
    const LocalizationQuery whole(at_middle(scan, sweep, T_start_end), labels, R_body_lidar);
    T_map_middle = localizer.align_at(whole, T_map_middle).T_map_lidar;
  }
  return std::nullopt;
}

StampedLocalization localize_lone_scan(const Localizer& localizer, const Scan& scan,
                                       const PointLabels& labels,
                                       const Eigen::Matrix3d& R_body_lidar, double period_s) {
  StampedLocalization as_measured{localizer.localize(scan, labels, R_body_lidar),
                                  SweepMotionSource::no_times};
  const SweepTimes sweep = sweep_times(scan, period_s);
  if (sweep.duration_s <= 0.0) return as_measured;
  as_measured.motion = SweepMotionSource::unknown;
  if (as_measured.result.places.empty()) return as_measured;
  const auto T_start_end = sweep_motion_in_map(localizer, scan, labels, sweep, R_body_lidar,
                                               as_measured.result.places.front().T_map_lidar);
  if (!T_start_end) return as_measured;
  const Scan at_stamp = deskew(scan, *T_start_end, sweep.duration_s);
  const LocalizationQuery query(at_stamp, labels, R_body_lidar);
  if (as_measured.result.status != LocalizationStatus::found)
    return {localizer.localize(query), SweepMotionSource::map};
  // What its motion was told at is where it is: it is not looked for elsewhere.
  LocalizationResult there = localizer.localize_at(query, as_measured.result.places);
  if (there.status == LocalizationStatus::not_found) return as_measured;
  return {std::move(there), SweepMotionSource::map};
}

}  // namespace stillmap
