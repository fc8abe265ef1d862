#include "core/odometry/motion_classification.hpp"

#include <tbb/parallel_for.h>

#include <cmath>
#include <utility>

#include "core/odometry/voxel_downsample.hpp"

namespace stillmap {
namespace {

/// A surface is the same one within this distance along the ray [m].
constexpr float same_surface_m = 0.3F;
/// A surface farther in front of the point than this belonged to another object [m].
constexpr float max_gone_gap_m = 3.0F;
/// Spacing of the points of an object that are looked up [m].
constexpr double sample_spacing_m = 0.2;
/// An object with fewer decisive samples stays undecided.
constexpr int min_samples = 5;
/// Share of decisive samples that must have been there before for an object to count as parked.
constexpr double parked_share = 0.6;

std::vector<std::uint32_t> sample_objects(const Scan& scan, const ObjectClusters& objects) {
  return voxel_downsample(scan.points_lidar, objects.movable_points, sample_spacing_m);
}

struct SampleObservation {
  bool was_there = false;
  bool moved = false;
};

SampleObservation observe_history(const Eigen::Vector3f& point_map,
                                  const RangeImageHistory& history, const RangeImageView& now) {
  SampleObservation seen;
  // What has moved is not asked for where it was before.
  for (std::size_t age = 0; age < history.size() && !seen.moved; ++age) {
    const PastObservation observation = history.observation(age, point_map, now);
    seen.moved =
        observation == PastObservation::free || observation == PastObservation::removed_in_front;
    if (age + 1 == history.size()) seen.was_there = observation == PastObservation::same;
  }
  return seen;
}

struct Votes {
  int samples = 0;
  int was_there = 0;
  int moved = 0;
};

MotionClass classify(const Votes& votes, bool has_full_history, const MotionConfig& config) {
  const int decisive = votes.was_there + votes.moved;
  if (decisive < min_samples) return MotionClass::undecided;
  if (votes.moved >= config.moving_share * decisive) return MotionClass::moving;
  const bool was_there = votes.was_there >= parked_share * votes.samples;
  return was_there && has_full_history ? MotionClass::parked : MotionClass::undecided;
}

/// Share of an object's samples that eq. (9) finds inconsistent, voted by object so that all of it
/// is treated alike.
std::vector<bool> inconsistent_objects(const Scan& scan, const PointLabels& labels,
                                       const ObjectClusters& objects,
                                       const Eigen::Isometry3d& T_map_lidar, const LocalMap& map,
                                       const OdometryConfig& config) {
  const std::vector<std::uint32_t> samples = sample_objects(scan, objects);
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  std::vector<double> inconsistency(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t s) {
    const std::uint32_t i = samples[s];
    const Neighbours near =
        map.planes.nearest(T * scan.points_lidar[i], config.registration.neighbours,
                           static_cast<float>(config.registration.max_neighbour_distance_m));
    inconsistency[s] = semantic_inconsistency(near, labels.classes[i]);
  });
  std::vector<int> votes(objects.count, 0);
  for (std::size_t s = 0; s < samples.size(); ++s)
    votes[static_cast<std::size_t>(objects.of_point[samples[s]])] +=
        inconsistency[s] > config.motion.inconsistency_threshold ? 1 : -1;
  std::vector<bool> inconsistent(objects.count);
  for (std::size_t k = 0; k < objects.count; ++k) inconsistent[k] = votes[k] > 0;
  return inconsistent;
}

}  // namespace

float RangeImageHistory::margin(float range_m) const {
  return static_cast<float>(config_.free_margin_m) +
         static_cast<float>(config_.free_margin_share) * range_m;
}

std::size_t RangeImageHistory::size() const {
  return views_.size() / static_cast<std::size_t>(config_.range_image_history_interval);
}

double RangeImageHistory::distance_from_oldest_m(const Eigen::Vector3d& position_map) const {
  if (size() < static_cast<std::size_t>(config_.range_image_history_size)) return 0.0;
  return (position_map - views_.front().origin_map().cast<double>()).norm();
}

PastObservation RangeImageHistory::observation(std::size_t age, const Eigen::Vector3f& point_map,
                                               const RangeImageView& now) const {
  const auto interval = static_cast<std::size_t>(config_.range_image_history_interval);
  const RangeImageView& past = views_[views_.size() - (age + 1) * interval];
  const auto observation = past.observe(point_map);
  if (!observation) return PastObservation::unknown;
  if (past.sees_past(*observation, observation->point_range_m + margin(observation->point_range_m)))
    return PastObservation::free;
  if (!observation->movable) return PastObservation::unknown;
  if (past.lies_on_surface(*observation, same_surface_m)) return PastObservation::same;
  const float gap = observation->point_range_m - observation->range_m;
  if (gap < margin(observation->range_m) || gap > max_gone_gap_m) return PastObservation::unknown;
  const Eigen::Vector3f direction_map =
      (point_map - past.origin_map()) / observation->point_range_m;
  const Eigen::Vector3f surface_map = past.origin_map() + observation->range_m * direction_map;
  return sees_through(now, surface_map) ? PastObservation::removed_in_front
                                        : PastObservation::unknown;
}

bool RangeImageHistory::sees_through(const RangeImageView& view,
                                     const Eigen::Vector3f& point_map) const {
  const auto observation = view.observe(point_map);
  return observation && view.sees_past(*observation, observation->point_range_m +
                                                         margin(observation->point_range_m));
}

bool RangeImageHistory::saw_fixed_at(const Eigen::Vector3f& point_map) const {
  if (views_.empty()) return false;
  const auto seen = views_.front().observe(point_map);
  return seen && !seen->movable && views_.front().lies_on_surface(*seen, same_surface_m);
}

void RangeImageHistory::add(RangeImageView view) {
  views_.push_back(std::move(view));
  const auto kept = static_cast<std::size_t>(config_.range_image_history_size *
                                             config_.range_image_history_interval);
  if (views_.size() > kept) views_.pop_front();
}

std::vector<MotionClass> classify_motion(const Scan& scan, const ObjectClusters& objects,
                                         const Eigen::Isometry3d& T_map_lidar,
                                         const RangeImageHistory& history,
                                         const RangeImageView& now, const MotionConfig& config) {
  std::vector<MotionClass> motion_classes(objects.count, MotionClass::undecided);
  if (history.size() == 0 || objects.count == 0) return motion_classes;
  const std::vector<std::uint32_t> samples = sample_objects(scan, objects);
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  std::vector<SampleObservation> seen(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t s) {
    seen[s] = observe_history(T * scan.points_lidar[samples[s]], history, now);
  });
  std::vector<Votes> votes(objects.count);
  for (std::size_t s = 0; s < samples.size(); ++s) {
    Votes& v = votes[static_cast<std::size_t>(objects.of_point[samples[s]])];
    ++v.samples;
    v.was_there += seen[s].was_there && !seen[s].moved ? 1 : 0;
    v.moved += seen[s].moved ? 1 : 0;
  }
  const bool has_full_history =
      history.size() == static_cast<std::size_t>(config.range_image_history_size);
  for (std::size_t k = 0; k < objects.count; ++k)
    motion_classes[k] = classify(votes[k], has_full_history, config);
  return motion_classes;
}

std::vector<Motion> classify_point_motion(const Scan& scan, const PointLabels& labels,
                                          const ObjectClusters& objects,
                                          std::span<const MotionClass> motion_classes,
                                          const Eigen::Isometry3d& T_map_lidar, const LocalMap& map,
                                          const OdometryConfig& config) {
  std::vector<Motion> motion(scan.size(), Motion::stationary);
  if (labels.empty()) return motion;
  std::vector<bool> moves(objects.count);
  if (config.motion.use_range_image_history) {
    for (std::size_t k = 0; k < objects.count; ++k)
      moves[k] = motion_classes[k] == MotionClass::moving;
  } else {
    moves = inconsistent_objects(scan, labels, objects, T_map_lidar, map, config);
  }
  for (const std::uint32_t i : objects.movable_points) {
    const auto object = static_cast<std::size_t>(objects.of_point[i]);
    motion[i] = moves[object] ? Motion::highly_dynamic : Motion::semi_static;
  }
  return motion;
}

}  // namespace stillmap
