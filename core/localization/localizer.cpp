#include "core/localization/localizer.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <utility>

namespace stillmap {
namespace {

/// What of the map a scan is registered in [m].
constexpr double surroundings_m = 45.0;

}  // namespace

const char* name(LocalizationStatus status) {
  switch (status) {
    case LocalizationStatus::found:
      return "found";
    case LocalizationStatus::ambiguous:
      return "ambiguous";
    case LocalizationStatus::not_found:
      return "not_found";
    case LocalizationStatus::no_evidence:
      return "no_evidence";
  }
  return "unknown";
}

Localizer::Localizer(std::shared_ptr<const PlaceIndex> index, const LocalizationConfig& config)
    : index_(std::move(index)), config_(config) {}

LocalizationResult Localizer::localize(const Scan& scan, const PointLabels& labels,
                                       const Eigen::Matrix3d& R_body_lidar) const {
  const LocalizationQuery query(scan, labels, R_body_lidar);
  if (index_->empty() ||
      query.features_upright.points.size() < static_cast<std::size_t>(config_.min_points))
    return {};
  const std::vector<PlaceCandidate> candidates =
      search_places(query, *index_, config_.places, config_.search);
  std::vector<PlaceHypothesis> places(candidates.size());
  Eigen::Isometry3d T_upright_lidar = Eigen::Isometry3d::Identity();
  T_upright_lidar.linear() = R_body_lidar;
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t k) {
    const auto points = index_->points_near(candidates[k].position_map, surroundings_m);
    const MapSurroundings surroundings(points);
    const Eigen::Isometry3d T =
        surroundings.align(query, T_map_upright(candidates[k], query, *index_));
    places[k] = {T * T_upright_lidar, surroundings.evidence(query, T), candidates[k].score};
  });
  std::ranges::stable_sort(places, [](const PlaceHypothesis& a, const PlaceHypothesis& b) {
    return a.evidence.score() > b.evidence.score();
  });
  std::vector<PlaceHypothesis> apart;
  for (const PlaceHypothesis& place : places) {
    if (std::ranges::all_of(
            apart, [&](const PlaceHypothesis& other) { return is_other_place(place, other); }))
      apart.push_back(place);
  }
  const LocalizationStatus status = judge(apart);
  return {status, std::move(apart)};
}

LocalizationStatus Localizer::judge(const std::vector<PlaceHypothesis>& places) const {
  if (places.empty()) return LocalizationStatus::not_found;
  const PoseEvidence& best = places.front().evidence;
  if (best.map_points < config_.min_map_points || best.explained < config_.min_explained ||
      best.confirmed < config_.min_confirmed || best.level < config_.min_level ||
      best.score() < config_.min_score)
    return LocalizationStatus::not_found;
  if (places.size() > 1 && places[1].evidence.score() > config_.max_other_share * best.score())
    return LocalizationStatus::ambiguous;
  return LocalizationStatus::found;
}

bool Localizer::is_other_place(const PlaceHypothesis& a, const PlaceHypothesis& b) const {
  const Eigen::Isometry3d off = a.T_map_lidar.inverse() * b.T_map_lidar;
  return off.translation().norm() > config_.min_other_m ||
         Eigen::AngleAxisd(off.linear()).angle() > config_.min_other_rad;
}

}  // namespace stillmap
