#include "core/odometry/shift_witnesses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>
#include <vector>

#include "core/odometry/correspondence_search.hpp"
#include "core/odometry/scan_features.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// So far to either side [m]: out of the reach of the neighbours of one place.
constexpr double way_beside_m = 0.6;
/// Share of their fit that the witnesses must lose there. Of right poses in car parks, on squares
/// and wide roads it is 0.7 and more, of drives that slide through tunnels at most 0.57, over crops
/// and meadows 0.17.
constexpr double min_share_lost = 0.65;
/// As many witnesses of equal weight as would lose as surely.
constexpr double min_witnesses = 16.0;
/// And as many places of this size [m] as would lose as surely: the back of a lorry has thirty
/// witnesses, and moves.
constexpr double min_places = 5.0;
constexpr double place_m = 4.0;
/// Distance at which the score of a fit is a quarter [m].
constexpr double score_scale_m = 0.2;

/// How well a feature lies on the map, 0..1, and what it counts as a witness of a shift, 0..1.
struct Witness {
  double score = 0.0;
  double weight = 0.0;
  /// In the lidar frame, in steps of place_m.
  std::array<int, 2> place{};
};

std::array<int, 2> place_of(const Eigen::Vector3d& point_lidar) {
  return {static_cast<int>(std::floor(point_lidar.x() / place_m)),
          static_cast<int>(std::floor(point_lidar.y() / place_m))};
}

Witness witness_of(const Correspondence& c, const Eigen::Isometry3d& T_map_lidar,
                   const PoseTangent& shift) {
  if (!c.found) return {};
  const Residual r = residual(c.point_lidar, T_map_lidar, c.surface);
  double squared_m2 = 0.0;
  double weight = 0.0;
  for (std::size_t k = 0; k < r.count; ++k) {
    const double along = r.slopes[k].dot(shift);
    squared_m2 += c.surface.weights[k] * r.distances[k] * r.distances[k];
    weight += c.surface.weights[k] * std::min(1.0, along * along);
  }
  const double ratio = score_scale_m * score_scale_m / (score_scale_m * score_scale_m + squared_m2);
  return {.score = ratio * ratio, .weight = weight * c.thinness, .place = place_of(c.point_lidar)};
}

/// So many equal parts have the same sum and the same sum of squares.
double effective_count(double sum, double squares) {
  return squares > 0.0 ? sum * sum / squares : 0.0;
}

/// Whether the witnesses lose enough of their fit at another place, and enough of them.
bool lose(std::span<const Witness> here, std::span<const Witness> beside) {
  double fit = 0.0;
  double lost = 0.0;
  double lost_squares = 0.0;
  std::map<std::array<int, 2>, double> lost_by_place;
  for (std::size_t i = 0; i < here.size(); ++i) {
    if (!(here[i].weight > 0.0)) continue;
    const double lost_here = here[i].weight * (here[i].score - beside[i].score);
    fit += here[i].weight * here[i].score;
    lost += lost_here;
    lost_squares += lost_here * lost_here;
    lost_by_place[here[i].place] += lost_here;
  }
  double place_squares = 0.0;
  for (const auto& [place, lost_there] : lost_by_place) place_squares += lost_there * lost_there;
  return lost > 0.0 && lost >= min_share_lost * fit &&
         effective_count(lost, lost_squares) >= min_witnesses &&
         effective_count(lost, place_squares) >= min_places;
}

}  // namespace

PoseTangent likely_shift(const OdometryResult& found, const Eigen::Vector3d& shift_map) {
  const PoseTangent along = found.covariance.leftCols<3>() * shift_map;
  return along / shift_map.dot(along.head<3>());
}

bool witnesses_tell(const PoseTangent& shift, const FeatureSets& features, const LocalMap& map,
                    const OdometryResult& found, const OdometryConfig& config) {
  const FeatureSets some = downsampled(features);
  const RegistrationLimits limits = limits_for(some, config.registration);
  const auto witnesses_at = [&](double way_m) {
    OdometryResult pose = found;
    pose.T_map_lidar = boxplus(found.T_map_lidar, way_m * shift);
    std::vector<Correspondence> correspondences(count_of(some));
    find_all_correspondences(some, map, pose, limits, correspondences);
    std::vector<Witness> witnesses;
    witnesses.reserve(correspondences.size());
    for (const Correspondence& c : correspondences)
      witnesses.push_back(witness_of(c, pose.T_map_lidar, shift));
    return witnesses;
  };
  const std::vector<Witness> here = witnesses_at(0.0);
  return std::ranges::all_of(std::array{-way_beside_m, way_beside_m},
                             [&](double way_m) { return lose(here, witnesses_at(way_m)); });
}

}  // namespace stillmap
