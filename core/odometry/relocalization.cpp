#include "core/odometry/relocalization.hpp"

#include <algorithm>
#include <numbers>
#include <vector>

namespace stillmap {
namespace {

/// A point of the scan lies on the map when a point of it is as near as this [m].
constexpr float match_distance_m = 0.25F;
/// Share of such points that ends the search, and the smallest share that is accepted.
constexpr double sure_match_ratio = 0.85;
constexpr double min_match_ratio = 0.6;
/// Distance between the guesses; the coarse registration converges from half of it.
constexpr double guess_spacing_m = 3.5;
constexpr int headings = 12;
constexpr double refinement_radius_m = 0.6;

bool is_pole_like(SemanticClass label) {
  return label == SemanticClass::pole || label == SemanticClass::trunk ||
         label == SemanticClass::traffic_sign;
}

/// Zero, and six offsets in a ring round it.
std::vector<Eigen::Vector3d> offsets_around(double radius_m) {
  std::vector<Eigen::Vector3d> places{Eigen::Vector3d::Zero()};
  for (int k = 0; k < 6; ++k) {
    const double bearing = k * std::numbers::pi / 3.0;
    places.emplace_back(radius_m * std::cos(bearing), radius_m * std::sin(bearing), 0.0);
  }
  return places;
}

/// The guess itself, then all headings there, then all headings at the places round it.
std::vector<Eigen::Isometry3d> pose_guesses_around(const Eigen::Isometry3d& T_map_lidar) {
  std::vector<Eigen::Isometry3d> guesses;
  for (const Eigen::Vector3d& place : offsets_around(guess_spacing_m)) {
    for (int k = 0; k < headings; ++k) {
      // 0, 1, -1, 2, ...: small turns first.
      const int steps = k % 2 == 0 ? -k / 2 : (k + 1) / 2;
      const double turn = steps * 2.0 * std::numbers::pi / headings;
      guesses.push_back(Eigen::Translation3d(place) * T_map_lidar *
                        Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()));
    }
  }
  return guesses;
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

/// Registers a scan from many places, and keeps the pose that fits best.
class Search {
 public:
  Search(const FeatureSets& features, const LocalMap& map, const OdometryConfig& config)
      : features_(features), map_(map), config_(config) {}

  void try_from(const Eigen::Isometry3d& T_map_lidar) {
    const OdometryResult found = register_features(features_, map_, T_map_lidar, config_);
    if (found.health == OdometryHealth::lost) return;
    const double share = match_ratio(features_, map_, found.T_map_lidar);
    if (share <= share_) return;
    share_ = share;
    best_ = found;
  }
  [[nodiscard]] const OdometryResult& best() const { return best_; }
  [[nodiscard]] double share() const { return share_; }

 private:
  const FeatureSets& features_;
  const LocalMap& map_;
  const OdometryConfig& config_;
  OdometryResult best_;
  double share_ = 0.0;
};

}  // namespace

void insert_prior_map(std::span<const LabelledPoint> points_map, LocalMap& map) {
  std::vector<LabelledPoint> edges;
  std::vector<LabelledPoint> planes;
  for (const LabelledPoint& point : points_map) {
    if (is_movable(point.label)) continue;
    (is_pole_like(point.label) ? edges : planes).push_back(point);
  }
  map.edges.insert(edges);
  map.planes.insert(planes);
}

OdometryResult relocalize(const FeatureSets& features, std::span<const LabelledPoint> prior_map,
                          const LocalMap& map, const Eigen::Isometry3d& T_map_lidar_guess,
                          const OdometryConfig& config) {
  LocalMap coarse_map = make_coarse_map();
  insert_prior_map(prior_map, coarse_map);
  Search search(features, map, config);
  for (const Eigen::Isometry3d& guess : pose_guesses_around(T_map_lidar_guess)) {
    const OdometryResult rough =
        register_features(features, coarse_map, guess, coarse_registration_config(config));
    if (rough.health != OdometryHealth::lost) search.try_from(rough.T_map_lidar);
    if (search.share() >= sure_match_ratio) return search.best();
  }
  // Refine: along a street the registration may stop short of the optimum.
  const Eigen::Isometry3d T_map_lidar_best = search.best().T_map_lidar;
  for (const Eigen::Vector3d& place : offsets_around(refinement_radius_m)) {
    search.try_from(Eigen::Translation3d(place) * T_map_lidar_best);
  }
  if (search.share() >= min_match_ratio) return search.best();
  // Against an empty map the registration returns the guess as lost.
  return register_features(features, make_coarse_map(), T_map_lidar_guess, config);
}

}  // namespace stillmap
