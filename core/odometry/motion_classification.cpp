#include "core/odometry/motion_classification.hpp"

#include <tbb/parallel_for.h>

#include "core/odometry/voxel_downsample.hpp"

namespace stillmap {
namespace {

/// Spacing of the points of an object that are looked up [m].
constexpr double sample_spacing_m = 0.2;
/// Fewer decisive samples say nothing of an object.
constexpr int min_samples = 5;
/// Share of decisive samples that must have been there before for an object to count as parked.
constexpr double parked_share = 0.6;

std::vector<std::uint32_t> sample_objects(const Scan& scan, const Objects& objects) {
  std::vector<std::uint32_t> movable;
  for (std::uint32_t i = 0; i < scan.size(); ++i)
    if (objects.of_point[i] != Objects::none) movable.push_back(i);
  return thin(scan.points_lidar, movable, sample_spacing_m);
}

struct SampleSight {
  bool was_there = false;
  bool moved = false;
};

SampleSight look_back(const Eigen::Vector3f& point_map, const PastViews& past,
                      const RangeView& now) {
  SampleSight seen;
  for (std::size_t age = 0; age < past.size(); ++age) {
    const PastSight sight = past.sight(age, point_map, now);
    seen.moved |= sight == PastSight::free || sight == PastSight::gone_before_it;
    if (age + 1 == past.size()) seen.was_there = sight == PastSight::same;
  }
  return seen;
}

struct Votes {
  int samples = 0;
  int was_there = 0;
  int moved = 0;
};

ObjectVerdict judge(const Votes& votes, bool has_full_past, const MotionConfig& config) {
  const int decisive = votes.was_there + votes.moved;
  if (decisive < min_samples) return ObjectVerdict::undecided;
  if (votes.moved >= config.moving_share * decisive) return ObjectVerdict::moving;
  const bool was_there = votes.was_there >= parked_share * votes.samples;
  return was_there && has_full_past ? ObjectVerdict::parked : ObjectVerdict::undecided;
}

/// Share of an object's samples that eq. (9) finds inconsistent, voted by object so that all of it
/// is treated alike.
std::vector<bool> inconsistent_objects(const Scan& scan, const PointLabels& labels,
                                       const Objects& objects, const Eigen::Isometry3d& T_map_lidar,
                                       const LocalMap& map, const OdometryConfig& config) {
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

std::vector<ObjectVerdict> judge_objects(const Scan& scan, const Objects& objects,
                                         const Eigen::Isometry3d& T_map_lidar,
                                         const PastViews& past, const RangeView& now,
                                         const MotionConfig& config) {
  std::vector<ObjectVerdict> verdicts(objects.count, ObjectVerdict::undecided);
  if (past.size() == 0 || objects.count == 0) return verdicts;
  const std::vector<std::uint32_t> samples = sample_objects(scan, objects);
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  std::vector<SampleSight> seen(samples.size());
  tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t s) {
    seen[s] = look_back(T * scan.points_lidar[samples[s]], past, now);
  });
  std::vector<Votes> votes(objects.count);
  for (std::size_t s = 0; s < samples.size(); ++s) {
    Votes& v = votes[static_cast<std::size_t>(objects.of_point[samples[s]])];
    ++v.samples;
    v.was_there += seen[s].was_there && !seen[s].moved ? 1 : 0;
    v.moved += seen[s].moved ? 1 : 0;
  }
  const bool has_full_past = past.size() == static_cast<std::size_t>(config.past_views);
  for (std::size_t k = 0; k < objects.count; ++k)
    verdicts[k] = judge(votes[k], has_full_past, config);
  return verdicts;
}

std::vector<Motion> split_by_motion(const Scan& scan, const PointLabels& labels,
                                    const Objects& objects, std::span<const ObjectVerdict> verdicts,
                                    const Eigen::Isometry3d& T_map_lidar, const LocalMap& map,
                                    const OdometryConfig& config) {
  std::vector<Motion> motion(scan.size(), Motion::stationary);
  if (labels.empty()) return motion;
  std::vector<bool> moves(objects.count);
  if (config.motion.use_past_views) {
    for (std::size_t k = 0; k < objects.count; ++k) moves[k] = verdicts[k] == ObjectVerdict::moving;
  } else {
    moves = inconsistent_objects(scan, labels, objects, T_map_lidar, map, config);
  }
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (objects.of_point[i] == Objects::none) continue;
    const auto object = static_cast<std::size_t>(objects.of_point[i]);
    motion[i] = moves[object] ? Motion::highly_dynamic : Motion::semi_static;
  }
  return motion;
}

}  // namespace stillmap
