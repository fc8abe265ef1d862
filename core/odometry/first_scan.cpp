#include "core/odometry/first_scan.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <vector>

#include "core/odometry/registration.hpp"
#include "core/odometry/scan_features.hpp"

namespace stillmap {
namespace {

/// What a motion between the scans makes of them, where they fit, and how much speaks for it.
struct Candidate {
  std::optional<StraightenedScans> scans;
  double score = 0.0;
};

/// The scans that are straightened, and how.
struct TwoScans {
  const FirstScan& first;
  const SecondScan& second;
  const OdometryConfig& config;
  const LocalMap& empty_map;
};

/// From that motion between the scans on; nothing where they do not fit.
std::optional<StraightenedScans> straightened(const TwoScans& scans,
                                              Eigen::Isometry3d T_first_second, int rounds) {
  StraightenedScans result{scans.empty_map, scans.first.T_map_stamp, {}};
  const SecondScan& second = scans.second;
  FeatureSets moving = second.features;
  for (int round = 0; round < rounds; ++round) {
    const PoseTangent velocity = twist_of(T_first_second) / second.interval_s;
    result.T_map_first = scans.first.T_map_stamp * motion_of(velocity * scans.first.sweep.middle_s);
    result.map.clear();
    extend_local_map(result.map, scans.first.features, result.T_map_first,
                     {.twist = velocity * scans.first.sweep.duration_s});
    moving.sweep_prior.T_map_lidar_last = result.T_map_first;
    result.second = register_features(moving, result.map,
                                      result.T_map_first * motion_of(velocity * second.interval_s),
                                      scans.config, {.twist = velocity * second.sweep.duration_s});
    if (result.second.health == OdometryHealth::lost) return std::nullopt;
    T_first_second = result.T_map_first.inverse() * result.second.T_map_lidar;
  }
  return result;
}

/// The motion that was found, and the same way faster: two bent scans amid traffic agree on a part
/// of the motion, too.
std::vector<Eigen::Isometry3d> possible_motions(const Eigen::Isometry3d& found, double interval_s,
                                                double max_speed_m_s) {
  constexpr double step_m_s = 5.0;
  constexpr double top_m_s = 30.0;
  constexpr double min_way_m = 0.05;
  const double way_m = found.translation().norm();
  const Eigen::Vector3d direction =
      way_m > min_way_m ? Eigen::Vector3d(found.translation() / way_m) : Eigen::Vector3d::UnitX();
  std::vector<Eigen::Isometry3d> motions{found};
  for (double speed = step_m_s; speed <= std::min(top_m_s, max_speed_m_s); speed += step_m_s) {
    motions.push_back(found);
    motions.back().translation() = speed * interval_s * direction;
  }
  return motions;
}

/// A motion other than the one that was found must score better by this factor.
constexpr double clearly_better = 1.03;

}  // namespace

bool can_begin_map(const FeatureSets& features, const OdometryConfig& config) {
  const auto needed = static_cast<std::size_t>(config.registration.min_correspondences);
  return features.edges.size() + features.planes.size() + features.surfaces.size() >= needed;
}

std::optional<StraightenedScans> straighten_first_scan(const FirstScan& first,
                                                       const SecondScan& second,
                                                       const BentScans& found,
                                                       const OdometryConfig& config,
                                                       double max_speed_m_s) {
  constexpr int first_rounds = 2;
  constexpr int more_rounds = 4;
  LocalMap empty_map = found.map;
  empty_map.clear();
  // Enough to tell the motions apart: one that is far off would take many steps to nowhere.
  constexpr int rough_iterations = 20;
  OdometryConfig rough = config;
  rough.registration.max_iterations = std::min(rough.registration.max_iterations, rough_iterations);
  const FeatureSets some = downsampled(second.features);
  const SecondScan some_of_second{some, second.sweep, second.interval_s};
  const TwoScans roughly{first, some_of_second, rough, empty_map};
  const std::vector<Eigen::Isometry3d> motions = possible_motions(
      found.T_map_first.inverse() * found.second.T_map_lidar, second.interval_s, max_speed_m_s);
  std::vector<Candidate> candidates(motions.size());
  tbb::parallel_for(std::size_t{0}, motions.size(), [&](std::size_t i) {
    Candidate& candidate = candidates[i];
    candidate.scans = straightened(roughly, motions[i], first_rounds);
    if (candidate.scans)
      candidate.score = score_of_first_motion(candidate.scans->second, second.features,
                                              candidate.scans->map, config);
  });
  Candidate& as_found = candidates.front();
  if (!as_found.scans)
    as_found.score = score_of_first_motion(found.second, second.features, found.map, config);
  const Candidate* best = &as_found;
  for (const Candidate& candidate : candidates)
    if (candidate.scans && candidate.score > clearly_better * best->score) best = &candidate;
  if (!best->scans) return std::nullopt;
  return straightened({first, second, config, empty_map},
                      best->scans->T_map_first.inverse() * best->scans->second.T_map_lidar,
                      more_rounds);
}

}  // namespace stillmap
