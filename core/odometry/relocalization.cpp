#include "core/odometry/relocalization.hpp"

#include <algorithm>
#include <numbers>
#include <vector>

#include "core/odometry/correlative_search.hpp"
#include "core/odometry/prior_map.hpp"
#include "core/odometry/scan_features.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// A point of the scan lies on the map when a point of it is as near as this [m].
constexpr float match_distance_m = 0.25F;
/// Share of such points at the guess that ends the search, and the smallest share that is accepted.
constexpr double sure_match_ratio = 0.85;
constexpr double min_match_ratio = 0.6;
/// A pose as near as this to the guess is where it was expected [m, rad].
constexpr double max_in_place_distance_m = 0.5;
constexpr double max_in_place_angle_rad = 0.05;
/// Another place, so far away [m], fits less well than by this share of the best.
constexpr double min_other_place_m = 1.5;
constexpr double max_other_share = 0.85;
/// Places that the correlative search proposes, for registration to try.
constexpr std::size_t proposals = 16;
constexpr double refinement_radius_m = 0.6;

/// Zero, and six offsets in a ring round it.
std::vector<Eigen::Vector3d> offsets_around(double radius_m) {
  std::vector<Eigen::Vector3d> places{Eigen::Vector3d::Zero()};
  for (int k = 0; k < 6; ++k) {
    const double bearing = k * std::numbers::pi / 3.0;
    places.emplace_back(radius_m * std::cos(bearing), radius_m * std::sin(bearing), 0.0);
  }
  return places;
}

/// Ground matches anywhere on the ground of the map, and movable objects may have left.
bool is_landmark(SemanticClass label) { return !is_ground(label) && !is_movable(label); }

double match_ratio(const FeatureSets& features, const LocalMap& map,
                   const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  int landmarks = 0;
  int matched = 0;
  const auto count = [&](const std::vector<FeaturePoint>& points) {
    for (const FeaturePoint& point : points) {
      if (!is_landmark(point.label)) continue;
      const Eigen::Vector3f position_map = T * point.position_lidar;
      ++landmarks;
      matched += map.planes.nearest(position_map, 1, match_distance_m).count > 0 ||
                         map.edges.nearest(position_map, 1, match_distance_m).count > 0
                     ? 1
                     : 0;
    }
  };
  count(features.edges);
  count(features.planes);
  count(features.surfaces);
  return landmarks > 0 ? static_cast<double>(matched) / landmarks : 0.0;
}

bool is_in_place(const Eigen::Isometry3d& T_map_lidar, const Eigen::Isometry3d& T_map_lidar_guess) {
  const PoseTangent off = boxminus(T_map_lidar, T_map_lidar_guess);
  return off.head<3>().norm() < max_in_place_distance_m &&
         off.tail<3>().norm() < max_in_place_angle_rad;
}

/// Registers a scan from many places, and keeps the pose that fits best.
class Search {
 public:
  Search(const FeatureSets& features, const LocalMap& map, const OdometryConfig& config)
      : features_(features), map_(map), config_(config) {}

  void try_from(const Eigen::Isometry3d& T_map_lidar) {
    const OdometryResult found = register_in_two_stages(features_, map_, T_map_lidar, config_);
    if (found.health == OdometryHealth::lost) return;
    found_.push_back({found, match_ratio(features_, map_, found.T_map_lidar)});
    if (found_.back().share > best().share) best_ = found_.size() - 1;
  }
  struct Found {
    OdometryResult result;
    double share = 0.0;
  };
  /// Of share 0 before the first.
  [[nodiscard]] const Found& best() const { return found_[best_]; }
  /// Whether no other place fits nearly as well: streets look alike.
  [[nodiscard]] bool is_unique() const {
    return std::ranges::none_of(found_, [&](const Found& other) {
      const Eigen::Isometry3d off = best().result.T_map_lidar.inverse() * other.result.T_map_lidar;
      return off.translation().norm() > min_other_place_m &&
             other.share > max_other_share * best().share;
    });
  }

 private:
  const FeatureSets& features_;
  const LocalMap& map_;
  const OdometryConfig& config_;
  std::vector<Found> found_{Found{}};
  std::size_t best_ = 0;
};

}  // namespace

std::vector<LabelledPoint> points_of(const LocalMap& map) {
  std::vector<LabelledPoint> points_map = map.edges.points();
  const std::vector<LabelledPoint> planes_map = map.planes.points();
  points_map.insert(points_map.end(), planes_map.begin(), planes_map.end());
  return points_map;
}

std::vector<Eigen::Isometry3d> propose_poses(const FeatureSets& features,
                                             std::span<const LabelledPoint> points_map,
                                             const Eigen::Isometry3d& T_map_lidar_guess,
                                             double reach_m, std::size_t count) {
  std::vector<Eigen::Vector3f> of_scan, of_map;
  for (const auto* points : {&features.edges, &features.planes, &features.surfaces})
    for (const FeaturePoint& point : *points)
      if (is_landmark(point.label)) of_scan.push_back(point.position_lidar);
  for (const LabelledPoint& point : points_map)
    if (is_landmark(point.label)) of_map.push_back(point.position_map);
  return correlative_search(of_scan, of_map, T_map_lidar_guess, count, {.reach_m = reach_m});
}

OdometryResult relocalize(const FeatureSets& features, std::span<const LabelledPoint> prior_map,
                          const LocalMap& map, const Eigen::Isometry3d& T_map_lidar_guess,
                          const OdometryConfig& config, double reach_m) {
  // A robot that stands where it was expected needs no search.
  const OdometryResult in_place = register_features(features, map, T_map_lidar_guess, config);
  if (in_place.health != OdometryHealth::lost &&
      is_in_place(in_place.T_map_lidar, T_map_lidar_guess) &&
      match_ratio(features, map, in_place.T_map_lidar) >= sure_match_ratio)
    return in_place;
  LocalMap coarse_map = make_coarse_map();
  insert_prior_map(prior_map, coarse_map);
  Search search(features, map, config);
  const auto try_coarsely_from = [&](const FeatureSets& points,
                                     const Eigen::Isometry3d& T_map_lidar, Search& into) {
    const OdometryResult rough =
        register_features(points, coarse_map, T_map_lidar, coarse_registration_config(config));
    if (rough.health != OdometryHealth::lost) into.try_from(rough.T_map_lidar);
  };
  try_coarsely_from(features, T_map_lidar_guess, search);
  if (search.best().share >= sure_match_ratio) return search.best().result;
  // Against an empty map the registration returns the guess as lost.
  const auto lost = [&] {
    return register_features(features, make_coarse_map(), T_map_lidar_guess, config);
  };
  if (reach_m <= 0.0) return lost();
  // Few features tell the place sooner.
  const FeatureSets few = downsampled(features);
  Search places(few, map, config);
  places.try_from(search.best().share > 0.0 ? search.best().result.T_map_lidar : T_map_lidar_guess);
  for (const Eigen::Isometry3d& T :
       propose_poses(few, prior_map, T_map_lidar_guess, reach_m, proposals)) {
    places.try_from(T);
    if (places.best().share < sure_match_ratio) try_coarsely_from(few, T, places);
  }
  // Refine: along a street the registration may stop short of the optimum.
  const Eigen::Isometry3d T_map_lidar_best = places.best().result.T_map_lidar;
  for (const Eigen::Vector3d& place : offsets_around(refinement_radius_m))
    search.try_from(Eigen::Translation3d(place) * T_map_lidar_best);
  if (search.best().share >= min_match_ratio && places.is_unique()) return search.best().result;
  return lost();
}

}  // namespace stillmap
