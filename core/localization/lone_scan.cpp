#include "core/localization/lone_scan.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/odometry/sweep_motion.hpp"

namespace stillmap {
namespace {

/// A motion of 0.7 m and 6 degrees a sweep takes five, one of 0.8 m and 12 degrees ten.
constexpr int max_iterations = 12;
/// The last one changes the motion by less [m, rad].
constexpr double steady_m = 0.1;
constexpr double steady_rad = 0.01;
/// One that moved by more has no pose unless its motion is known: it would be off by up to half of
/// that, and by what bent the scan [m, rad].
constexpr double max_unknown_m = 0.5;
constexpr double max_unknown_rad = 0.035;
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

bool is_within(const Eigen::Isometry3d& motion, double distance_m, double angle_rad) {
  return motion.translation().norm() < distance_m &&
         Eigen::AngleAxisd(motion.linear()).angle() < angle_rad;
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

SweepInMap sweep_in_map(const Localizer& localizer, const Scan& scan, const PointLabels& labels,
                        const SweepTimes& sweep, const Eigen::Matrix3d& R_body_lidar,
                        const Eigen::Isometry3d& T_map_lidar) {
  SweepInMap found{.T_map_middle = T_map_lidar};
  for (int k = 0; k < max_iterations && !found.is_known; ++k) {
    const Scan moved = at_middle(scan, sweep, found.T_start_end);
    const auto aligned = [&](bool is_second) {
      const HalfOfSweep half = half_of(moved, labels, sweep, is_second);
      return localizer.align_at(LocalizationQuery(half.scan, half.labels, R_body_lidar),
                                found.T_map_middle);
    };
    const PlaceHypothesis first = aligned(false);
    const PlaceHypothesis second = aligned(true);
    const Eigen::Isometry3d T_first_second = first.T_map_lidar.inverse() * second.T_map_lidar;
    const Eigen::Isometry3d more = T_first_second * T_first_second;
    found.T_start_end = found.T_start_end * more;
    found.is_known = is_within(more, steady_m, steady_rad) && is_half_there(first.evidence) &&
                     is_half_there(second.evidence);
    const LocalizationQuery whole(at_middle(scan, sweep, found.T_start_end), labels, R_body_lidar);
    found.T_map_middle = localizer.align_at(whole, found.T_map_middle).T_map_lidar;
  }
  return found;
}

namespace {

/// Places of a scan as it was measured become those of the same scan at its stamp: all were
/// registered with the same bend.
void move_to_stamp(std::vector<PlaceHypothesis>& places, const SweepInMap& found,
                   const SweepTimes& sweep) {
  const double part = std::clamp(-sweep.middle_s / sweep.duration_s, -0.5, 0.5);
  const Eigen::Isometry3d T_map_stamp =
      found.T_map_middle * SweepMotion(found.T_start_end).T_middle_at(part);
  const Eigen::Isometry3d T_measured_stamp = places.front().T_map_lidar.inverse() * T_map_stamp;
  for (PlaceHypothesis& place : places) place.T_map_lidar = place.T_map_lidar * T_measured_stamp;
}

}  // namespace

StampedLocalization localize_lone_scan(const Localizer& localizer, const Scan& scan,
                                       const PointLabels& labels,
                                       const Eigen::Matrix3d& R_body_lidar, double period_s) {
  StampedLocalization as_measured{localizer.localize(scan, labels, R_body_lidar),
                                  SweepMotionSource::no_times};
  const SweepTimes sweep = sweep_times(scan, period_s);
  if (sweep.duration_s <= 0.0) return as_measured;
  as_measured.motion = SweepMotionSource::unknown;
  std::vector<PlaceHypothesis> places = as_measured.result.places;
  if (places.empty()) return as_measured;
  const bool was_found = as_measured.result.status == LocalizationStatus::found;
  const SweepInMap found =
      sweep_in_map(localizer, scan, labels, sweep, R_body_lidar, places.front().T_map_lidar);
  if (was_found && !is_within(found.T_start_end, max_unknown_m, max_unknown_rad))
    as_measured.result.status = LocalizationStatus::ambiguous;
  if (!found.is_known) return as_measured;
  const Scan at_stamp = deskew(scan, found.T_start_end, sweep.duration_s);
  const LocalizationQuery query(at_stamp, labels, R_body_lidar);
  if (!was_found) return {localizer.localize(query), SweepMotionSource::map};
  // What its motion was told at is where it is: it is not looked for elsewhere.
  move_to_stamp(places, found, sweep);
  LocalizationResult there = localizer.localize_at(query, places);
  if (there.status == LocalizationStatus::not_found) return as_measured;
  return {std::move(there), SweepMotionSource::map};
}

}  // namespace stillmap
