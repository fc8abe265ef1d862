#include "core/graph/submap_match.hpp"

#include <algorithm>
#include <cmath>

#include "core/frames/rigid_motion.hpp"
#include "core/graph/ceiling.hpp"
#include "core/graph/submap_registration.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// Poses that are no farther apart are one [m].
constexpr double same_pose_m = 0.3;
/// No storey is lower than this [m].
constexpr double min_storey_m = 1.0;
/// From a ceiling to the floor above it, at least [m].
constexpr double slab_m = 0.3;

Eigen::Isometry2d in_plan(const Eigen::Isometry3d& T) {
  const Eigen::Vector3d ahead = T.linear().col(0);
  Eigen::Isometry2d plan = Eigen::Isometry2d::Identity();
  plan.linear() = Eigen::Rotation2Dd(std::atan2(ahead.y(), ahead.x())).toRotationMatrix();
  plan.translation() = T.translation().head<2>();
  return plan;
}

/// An upright pose at this place of the plan and height.
Eigen::Isometry3d in_space(const Eigen::Isometry2d& plan, double z_m) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear().topLeftCorner<2, 2>() = plan.linear();
  T.translation() << plan.translation(), z_m;
  return T;
}

std::string fault_of(const OdometryResult& found, const SubmapMatchConfig& config) {
  if (found.health == OdometryHealth::lost) return "the submaps do not meet";
  if (found.health != OdometryHealth::good) return "the submaps may slide along one another";
  if (found.overlap < config.min_overlap) return "too little of the submaps meets";
  if (found.fit < config.min_fit || found.upright_fit < config.min_upright_fit)
    return "the submaps do not fit";
  return "";
}

/// Whether the place, which is higher by this than where b was expected in a, is as likely the
/// storey beside that: there is a ceiling over the lower one of both, and the floor above it is
/// nearer to where b was expected.
bool may_be_other_storey(const PlacedSubmap& a, const PlacedSubmap& b,
                         const Eigen::Isometry3d& T_a_b, double height_m) {
  const Eigen::Isometry2d plan = in_plan(T_a_b);
  // Expected above a, or below it.
  const auto ceiling_m =
      height_m < 0.0 ? ceiling_height_m(a, b, plan.inverse()) : ceiling_height_m(b, a, plan);
  return ceiling_m && std::abs(height_m) > 0.5 * (*ceiling_m + slab_m);
}

}  // namespace

AlignmentWindow window_after(const DriftModel& drift, double way_m) {
  return {.reach_m = std::min(drift.offset_m + drift.share_of_way * way_m, drift.max_m),
          .reach_rad =
              std::min(drift.heading_rad + drift.heading_rad_per_m * way_m, drift.max_heading_rad),
          .reach_height_m =
              std::min(drift.height_offset_m + drift.height_share_of_way * way_m, drift.max_m)};
}

std::optional<SubmapMatch> match_submaps(const PlacedSubmap& a, const PlacedSubmap& b,
                                         const Eigen::Isometry3d& T_a_b_expected,
                                         const AlignmentWindow& window,
                                         const SubmapMatchConfig& config) {
  const PlanAlignments aligned = align_in_plan(a.image, b.image, in_plan(T_a_b_expected), window);
  // Where nothing that stands up meets, no place is the best.
  if (!(aligned.best.score > 0.0)) return std::nullopt;
  const auto offset_m = ground_offset_m(a.image, b.image, aligned.best.T_a_b);
  if (!offset_m) return std::nullopt;

  const SubmapTarget target(a.submap);
  const double expected_z_m = T_a_b_expected.translation().z();
  const bool is_of_other_level =
      window.has_levels && std::abs(*offset_m - expected_z_m) > window.reach_height_m;
  const double guess_z_m = is_of_other_level ? expected_z_m : *offset_m;
  const Eigen::Isometry3d T_a_b_guess = in_space(aligned.best.T_a_b, guess_z_m);
  const OdometryResult found = target.register_submap(b.submap, T_a_b_guess);
  SubmapMatch match{
      .T_a_b = found.T_map_lidar,
      .key_information = Matrix6d::Identity(),
      .fit = found.fit,
      .upright_fit = found.upright_fit,
      .overlap = found.overlap,
      .runner_up = aligned.runner_up.score / std::max(aligned.best.score, 1e-9),
      .jump_m = (T_a_b_expected.translation() - found.T_map_lidar.translation()).norm(),
      .refusal = fault_of(found, config)};
  if (!match.refusal.empty()) return match;

  const double height_m = found.T_map_lidar.translation().z() - expected_z_m;
  if (std::abs(height_m) > window.reach_height_m) {
    match.refusal = "it is higher or lower than odometry can have drifted: another storey";
    return match;
  }
  if (std::abs(height_m) > min_storey_m && may_be_other_storey(a, b, found.T_map_lidar, height_m)) {
    match.refusal = "it is nearer to the storey above or below: there is a ceiling between";
    return match;
  }
  const Eigen::Isometry3d refinement = T_a_b_guess.inverse() * found.T_map_lidar;
  if (refinement.translation().norm() > config.max_refinement_m ||
      so3_log(refinement.linear()).norm() > config.max_refinement_rad) {
    match.refusal = "registration left the place that the plan showed";
  } else if (match.runner_up > config.max_runner_up) {
    const OdometryResult other =
        target.register_submap(b.submap, in_space(aligned.runner_up.T_a_b, guess_z_m));
    const double away_m =
        (other.T_map_lidar.translation() - found.T_map_lidar.translation()).norm();
    if (other.health != OdometryHealth::lost && away_m > same_pose_m &&
        other.upright_fit > found.upright_fit - config.min_fit_margin)
      match.refusal = "another place fits nearly as well";
  }
  match.key_information =
      turned_covariance(edge_information(found), b.submap.T_submap_key.linear().transpose());
  return match;
}

}  // namespace stillmap
