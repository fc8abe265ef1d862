#include "core/localization/global_localization.hpp"

#include <algorithm>
#include <utility>

namespace stillmap {
namespace {

/// Hypotheses that are carried from scan to scan.
constexpr std::size_t max_hypotheses = 8;

PoseEvidence mean_of(const std::vector<PoseEvidence>& all) {
  PoseEvidence sum{.high_agreed = 0.0};
  for (const PoseEvidence& evidence : all) {
    sum.explained += evidence.explained;
    sum.confirmed += evidence.confirmed;
    sum.level += evidence.level;
    sum.scan_points += evidence.scan_points;
    sum.map_points += evidence.map_points;
    sum.level_points += evidence.level_points;
    sum.close += evidence.close;
    sum.high_agreed += evidence.high_agreed;
  }
  const auto count = static_cast<int>(all.size());
  if (count == 0) return {};
  return {.explained = sum.explained / count,
          .confirmed = sum.confirmed / count,
          .level = sum.level / count,
          .scan_points = sum.scan_points / count,
          .map_points = sum.map_points / count,
          .level_points = sum.level_points / count,
          .close = sum.close / count,
          .high_agreed = sum.high_agreed / count};
}

bool is_within(const Eigen::Isometry3d& off, double distance_m, double angle_rad) {
  return off.translation().norm() < distance_m &&
         Eigen::AngleAxisd(off.linear()).angle() < angle_rad;
}

}  // namespace

const char* name(GlobalLocalization::Outcome outcome) {
  using enum GlobalLocalization::Outcome;
  switch (outcome) {
    case nothing_new:
      return "no new scan";
    case no_evidence:
      return "no evidence";
    case not_found:
      return "not found";
    case ambiguous:
      return "ambiguous";
    case found:
      return "found";
    case confirming:
      return "being confirmed";
    case confirmed:
      return "confirmed";
    case refused:
      return "refused by the scans after it";
  }
  return "unknown";
}

GlobalLocalization::GlobalLocalization(const OdometryConfig& odometry, const SensorModel& sensor,
                                       const GlobalLocalizationConfig& config)
    : sensor_(sensor), config_(config), odometry_(odometry, sensor) {}

void GlobalLocalization::forget_evidence() {
  window_.clear();
  hypotheses_.clear();
  T_map_odom_.reset();
}

void GlobalLocalization::follow(const Scan& scan, const PointLabels& labels) {
  const SweepTimes sweep = sweep_times(scan, sensor_.period_s);
  const auto register_scan = [&] {
    Scan moved = scan;
    odometry_.sweep_motion(sweep).move_to_middle(moved, sweep);
    const Odometry::Step step = odometry_.register_scan(moved, sweep, labels, std::nullopt);
    scan_ = std::move(moved);
    T_odom_lidar_ = step.result.T_map_lidar;
    return step.result;
  };
  const OdometryResult followed = register_scan();
  const bool is_lost = followed.health == OdometryHealth::lost || !followed.is_confirmed();
  // Nothing tells what lies between the scans before and this one.
  if (is_lost || followed.health == OdometryHealth::initialised) forget_evidence();
  if (is_lost) {
    odometry_.reset();
    static_cast<void>(register_scan());
  }
  labels_ = labels;
  is_new_ = true;
}

GlobalLocalization::Outcome GlobalLocalization::search(const Localizer& localizer,
                                                       const Eigen::Matrix3d& R_body_lidar,
                                                       const Regions& regions) {
  if (!is_new_) return Outcome::nothing_new;
  is_new_ = false;
  ++scans_tried_;
  const LocalizationQuery query(scan_, labels_, R_body_lidar);
  return T_map_odom_ ? confirm(localizer, query) : look_for(localizer, query, regions);
}

GlobalLocalization::Outcome GlobalLocalization::look_for(const Localizer& localizer,
                                                         const LocalizationQuery& query,
                                                         const Regions& regions) {
  LocalizationResult result = localizer.localize(query, regions.searched);
  const auto score = [&](std::size_t k) {
    return k < result.places.size() ? result.places[k].evidence.score() : 0.0;
  };
  best_score_ = score(0);
  runner_up_score_ = score(1);
  if (result.status == LocalizationStatus::no_evidence) return Outcome::no_evidence;
  result.status = judge_places(result.places, localizer.config(), regions.searched.has_value());
  if (result.status == LocalizationStatus::found)
    return take_found(result.places.front().T_map_lidar);
  if (result.status == LocalizationStatus::ambiguous && regions.expected) {
    const LocalizationResult near = localizer.localize(query, regions.expected);
    if (near.status == LocalizationStatus::found)
      return take_found(near.places.front().T_map_lidar);
  }
  move_window();
  add_evidence(localizer, query, std::move(result.places));
  std::vector<PlaceHypothesis> places = mean_places();
  put_believed_first(places, localizer.config());
  const bool is_of_several = window_.size() > 1;
  const LocalizationStatus status =
      is_of_several ? judge_places(places, localizer.config(), regions.searched.has_value())
                    : result.status;
  if (is_of_several && status == LocalizationStatus::found)
    return take_found(places.front().T_map_lidar);
  return status == LocalizationStatus::ambiguous ? Outcome::ambiguous : Outcome::not_found;
}

GlobalLocalization::Outcome GlobalLocalization::take_found(const Eigen::Isometry3d& T_map_lidar) {
  T_map_odom_ = T_map_lidar * T_odom_lidar_.inverse();
  agreeing_scans_ = 0;
  denying_scans_ = 0;
  return Outcome::found;
}

void GlobalLocalization::move_window() {
  const bool is_near =
      !window_.empty() &&
      (window_.back().inverse() * T_odom_lidar_).translation().norm() < config_.step_m;
  const auto leave_out = [&](auto choose) {
    window_.erase(choose(window_));
    for (Hypothesis& hypothesis : hypotheses_)
      hypothesis.evidence.erase(choose(hypothesis.evidence));
  };
  if (is_near) {
    leave_out([](auto& all) { return all.end() - 1; });
  } else if (window_.size() == config_.max_scans) {
    leave_out([](auto& all) { return all.begin(); });
  }
  window_.push_back(T_odom_lidar_);
}

void GlobalLocalization::add_evidence(const Localizer& localizer, const LocalizationQuery& query,
                                      std::vector<PlaceHypothesis> places) {
  for (Hypothesis& hypothesis : hypotheses_) {
    const Eigen::Isometry3d T_map_lidar = hypothesis.T_map_odom * T_odom_lidar_;
    const auto is_it = [&](const PlaceHypothesis& place) {
      return !is_other_place(place.T_map_lidar, T_map_lidar, localizer.config());
    };
    const auto known = std::ranges::find_if(places, is_it);
    const PlaceHypothesis there =
        known != places.end() ? *known : localizer.align_at(query, T_map_lidar);
    if (known != places.end()) places.erase(known);
    const bool is_there = is_it(there);
    hypothesis.evidence.push_back(is_there ? there.evidence : PoseEvidence{});
    // What was pinned is carried on by odometry where a scan may slide.
    if (!is_there || (there.may_slide && !hypothesis.may_slide)) continue;
    hypothesis.T_map_odom = there.T_map_lidar * T_odom_lidar_.inverse();
    hypothesis.may_slide = there.may_slide;
  }
  // The scans before would have named them, had they been among the best there.
  for (const PlaceHypothesis& place : places) {
    std::vector<PoseEvidence> evidence(window_.size() - 1);
    evidence.push_back(place.evidence);
    hypotheses_.push_back(
        {place.T_map_lidar * T_odom_lidar_.inverse(), std::move(evidence), place.may_slide});
  }
  std::ranges::stable_sort(hypotheses_, [](const Hypothesis& a, const Hypothesis& b) {
    return mean_of(a.evidence).score() > mean_of(b.evidence).score();
  });
  if (hypotheses_.size() > max_hypotheses) hypotheses_.resize(max_hypotheses);
}

std::vector<PlaceHypothesis> GlobalLocalization::mean_places() const {
  std::vector<PlaceHypothesis> places;
  for (const Hypothesis& hypothesis : hypotheses_)
    places.push_back({.T_map_lidar = hypothesis.T_map_odom * T_odom_lidar_,
                      .evidence = mean_of(hypothesis.evidence),
                      .may_slide = hypothesis.may_slide});
  return places;
}

GlobalLocalization::Outcome GlobalLocalization::confirm(const Localizer& localizer,
                                                        const LocalizationQuery& query) {
  const Eigen::Isometry3d T_map_lidar_expected = *T_map_odom_ * T_odom_lidar_;
  const PlaceHypothesis there = localizer.align_at(query, T_map_lidar_expected);
  const LocalizationConfig& limits = localizer.config();
  best_score_ = there.evidence.score();
  // What shows nothing, or is where the map has nothing, neither confirms nor denies.
  if (there.evidence.scan_points < limits.min_points ||
      there.evidence.map_points < limits.min_map_points)
    return Outcome::confirming;
  const bool agrees = is_within(T_map_lidar_expected.inverse() * there.T_map_lidar, config_.same_m,
                                config_.same_rad) &&
                      is_believed(there.evidence, limits);
  if (agrees) {
    if (!there.may_slide) T_map_odom_ = there.T_map_lidar * T_odom_lidar_.inverse();
    return ++agreeing_scans_ < config_.confirming_scans ? Outcome::confirming : Outcome::confirmed;
  }
  if (++denying_scans_ < config_.contradicting_scans) return Outcome::confirming;
  forget_evidence();
  return Outcome::refused;
}

GlobalLocalization::Place GlobalLocalization::take_place() {
  return {*T_map_odom_, std::move(odometry_)};
}

}  // namespace stillmap
