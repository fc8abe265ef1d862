#include "core/localization/localizer.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
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

LocalizationResult Localizer::localize(const LocalizationQuery& query,
                                       const std::optional<SearchRegion>& region) const {
  if (index_->empty() ||
      query.features_upright.points.size() < static_cast<std::size_t>(config_.min_points))
    return {};
  const std::vector<PlaceCandidate> candidates =
      search_places(query, *index_, config_.places, config_.search, region);
  std::vector<PlaceHypothesis> places(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t k) {
    places[k] =
        align_at(query, T_map_upright(candidates[k], query, *index_) * query.T_upright_lidar);
    places[k].search_score = candidates[k].score;
  });
  return judged(query, std::move(places));
}

LocalizationResult Localizer::localize_at(const LocalizationQuery& query,
                                          std::span<const PlaceHypothesis> places) const {
  std::vector<PlaceHypothesis> there(places.size());
  tbb::parallel_for(std::size_t{0}, places.size(),
                    [&](std::size_t k) { there[k] = align_at(query, places[k].T_map_lidar); });
  return judged(query, std::move(there));
}

LocalizationResult Localizer::judged(const LocalizationQuery& query,
                                     std::vector<PlaceHypothesis> places) const {
  std::ranges::stable_sort(places, [](const PlaceHypothesis& a, const PlaceHypothesis& b) {
    return a.evidence.score() > b.evidence.score();
  });
  std::vector<PlaceHypothesis> apart;
  for (const PlaceHypothesis& place : places) {
    if (std::ranges::all_of(apart, [&](const PlaceHypothesis& other) {
          return is_other_place(place.T_map_lidar, other.T_map_lidar, config_);
        }))
      apart.push_back(place);
  }
  put_believed_first(apart, config_);
  add_other_storeys(query, apart);
  drop_denied_storeys(query, apart);
  const LocalizationStatus status = judge_places(apart, config_);
  return {status, std::move(apart)};
}

void Localizer::add_other_storeys(const LocalizationQuery& query,
                                  std::vector<PlaceHypothesis>& places) const {
  if (!index_->has_storeys() || places.empty() || !is_believed(places.front().evidence, config_))
    return;
  const Eigen::Isometry3d T_best = places.front().T_map_lidar;
  const Eigen::Isometry3d T_map_foot =
      T_best * query.T_upright_lidar.inverse() * query.T_foot_upright.inverse();
  const Eigen::Vector2d place_map = T_best.translation().head<2>();
  double ground_m = T_map_foot.translation().z();
  if (!query.has_ground) ground_m -= index_->body_height_m(place_map);
  for (const double floor_m : index_->floors_near(place_map, index_->config().corridor_m)) {
    if (std::abs(floor_m - ground_m) < config_.min_other_m) continue;
    const Eigen::Isometry3d T_there = Eigen::Translation3d(0.0, 0.0, floor_m - ground_m) * T_best;
    const PlaceHypothesis there = align_at(query, T_there);
    const bool is_new = std::ranges::all_of(places, [&](const PlaceHypothesis& known) {
      return is_other_place(known.T_map_lidar, there.T_map_lidar, config_);
    });
    if (is_new) places.push_back(there);
  }
  std::ranges::stable_sort(places, [](const PlaceHypothesis& a, const PlaceHypothesis& b) {
    return a.evidence.score() > b.evidence.score();
  });
  put_believed_first(places, config_);
}

void Localizer::drop_denied_storeys(const LocalizationQuery& query,
                                    std::vector<PlaceHypothesis>& places) const {
  for (std::size_t k = 1; k < places.size(); ++k) {
    const Eigen::Isometry3d& T_best = places.front().T_map_lidar;
    const Eigen::Isometry3d& T_other = places[k].T_map_lidar;
    const Eigen::Isometry3d off = T_best.inverse() * T_other;
    const bool is_above_or_below =
        (T_other.translation() - T_best.translation()).head<2>().norm() < config_.min_other_m &&
        Eigen::AngleAxisd(off.linear()).angle() < config_.min_other_rad;
    if (!is_above_or_below) continue;
    const auto points = index_->points_near(T_best.translation().head<2>(), surroundings_m);
    const auto [only_best, only_other] = MapSurroundings(points).explained_by_one(
        query, T_best * query.T_upright_lidar.inverse(), T_other * query.T_upright_lidar.inverse());
    const auto tells = [&](int one, int other) {
      return one >= config_.min_telling_points && one >= config_.min_telling_ratio * other;
    };
    const bool is_other_right = tells(only_other, only_best);
    if (!is_other_right && !tells(only_best, only_other)) continue;
    if (is_other_right) std::swap(places.front(), places[k]);
    places.erase(places.begin() + static_cast<std::ptrdiff_t>(k));
    // A new best one is compared with all.
    k = is_other_right ? 0 : k - 1;
  }
}

PlaceHypothesis Localizer::align_at(const LocalizationQuery& query,
                                    const Eigen::Isometry3d& T_map_lidar) const {
  const auto points = index_->points_near(T_map_lidar.translation().head<2>(), surroundings_m);
  const MapSurroundings surroundings(points);
  const Eigen::Isometry3d T =
      surroundings.align(query, T_map_lidar * query.T_upright_lidar.inverse());
  PlaceHypothesis by_points{.T_map_lidar = T * query.T_upright_lidar,
                            .evidence = surroundings.evidence(query, T)};
  if (by_points.evidence.score() < config_.min_registered_score) return by_points;
  const auto on_surfaces = surroundings.align_surfaces(query, T);
  if (!on_surfaces) return by_points;
  const Eigen::Isometry3d& T_surfaces = on_surfaces->T_map_upright;
  PlaceHypothesis place{.T_map_lidar = T_surfaces * query.T_upright_lidar,
                        .evidence = surroundings.evidence(query, T_surfaces),
                        .may_slide = on_surfaces->may_slide};
  const double points_score = by_points.evidence.score();
  if (!on_surfaces->is_elsewhere)
    return place.evidence.score() < config_.min_kept_score * points_score ? by_points : place;
  // What stands up hardly tells how a lidar of few rings is tilted, as on a slope that the path's
  // ground does not show.
  if (place.evidence.score() > points_score && place.evidence.level >= by_points.evidence.level)
    return place;
  by_points.may_slide = true;
  return by_points;
}

namespace {

bool is_believed_without_heights(const PoseEvidence& evidence, const LocalizationConfig& config) {
  return evidence.map_points >= config.min_map_points &&
         evidence.explained >= config.min_explained && evidence.confirmed >= config.min_confirmed &&
         evidence.level >= config.min_level && evidence.score() >= config.min_score;
}

}  // namespace

bool is_believed(const PoseEvidence& evidence, const LocalizationConfig& config) {
  return is_believed_without_heights(evidence, config) &&
         evidence.high_agreed >= config.min_high_agreed;
}

void put_believed_first(std::vector<PlaceHypothesis>& places, const LocalizationConfig& config) {
  const auto believed = std::ranges::find_if(
      places, [&](const PlaceHypothesis& place) { return is_believed(place.evidence, config); });
  if (believed == places.end() || believed == places.begin()) return;
  if (is_believed_without_heights(places.front().evidence, config))
    std::rotate(places.begin(), believed, believed + 1);
}

LocalizationStatus judge_places(std::span<const PlaceHypothesis> places,
                                const LocalizationConfig& config, bool is_guessed) {
  if (places.empty() || !is_believed(places.front().evidence, config))
    return LocalizationStatus::not_found;
  const PoseEvidence& best = places.front().evidence;
  const bool is_close = best.close_score() >= config.min_close_score;
  // What lies close there tells nothing of a place that the map knows thinly.
  constexpr double min_known_share = 0.7;
  for (const PlaceHypothesis& other : places.subspan(1)) {
    if (other.evidence.score() <= config.max_other_share * best.score()) continue;
    const bool is_thin = other.evidence.map_points < min_known_share * best.map_points;
    if (!is_close || is_thin ||
        other.evidence.close_score() > config.max_other_share * best.close_score())
      return LocalizationStatus::ambiguous;
  }
  const bool may_slide = places.front().may_slide && !is_guessed;
  return may_slide ? LocalizationStatus::ambiguous : LocalizationStatus::found;
}

bool is_other_place(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b,
                    const LocalizationConfig& config) {
  const Eigen::Isometry3d off = a.inverse() * b;
  return off.translation().norm() > config.min_other_m ||
         Eigen::AngleAxisd(off.linear()).angle() > config.min_other_rad;
}

}  // namespace stillmap
