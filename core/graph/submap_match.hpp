#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <utility>

#include "core/graph/pose_graph.hpp"
#include "core/graph/submap.hpp"
#include "core/graph/upright_image.hpp"

namespace stillmap {

/// How far odometry may have gone astray: what a loop closure must not contradict.
struct DriftModel {
  /// Of a way, along with what any closure may be off [m].
  double share_of_way = 0.01;
  double offset_m = 2.0;
  double max_m = 25.0;
  /// The same in height: a storey of a car park is 3 m above the last one, 200 m of way before.
  double height_share_of_way = 0.005;
  double height_offset_m = 1.0;
  /// Of the heading [rad], [rad/m].
  double heading_rad = 0.026;
  double heading_rad_per_m = 0.00006;
  double max_heading_rad = 0.2;
  /// Standard deviations of the odometry over a way of one metre: they grow with its root.
  double translation_m = 0.01;
  double rotation_rad = 0.0004;
};

/// Where drift may have led to over this way.
[[nodiscard]] AlignmentWindow window_after(const DriftModel& drift, double way_m);

/// What a match of two submaps must reach (see OdometryResult).
struct SubmapMatchConfig {
  double min_overlap = 0.5;
  double min_fit = 0.4;
  double min_upright_fit = 0.5;
  /// The runner-up of the plan alignment may reach this share of the best one's score; above it, it
  /// must lead to the same pose, or fit worse by `min_fit_margin`.
  double max_runner_up = 0.75;
  double min_fit_margin = 0.08;
  /// Registration moves what the plan alignment found by at most this.
  double max_refinement_m = 1.5;
  double max_refinement_rad = 0.06;
};

/// A submap as it is looked for in another.
struct PlacedSubmap {
  explicit PlacedSubmap(Submap its_submap)
      : submap(std::move(its_submap)), image(submap.points_submap) {}

  [[nodiscard]] std::size_t bytes() const { return submap.bytes() + image.bytes(); }

  Submap submap;
  UprightImage image;
};

/// Where one submap lies in another.
struct SubmapMatch {
  Eigen::Isometry3d T_a_b = Eigen::Isometry3d::Identity();
  /// Inverse covariance of T_a_b along the axes of b's key: that of a PoseEdge between keys.
  Matrix6d key_information = Matrix6d::Identity();
  /// How well they lie on one another: see OdometryResult.
  double fit = 0.0;
  double upright_fit = 0.0;
  double overlap = 0.0;
  /// Score of the second best place in plan over that of the best.
  double runner_up = 0.0;
  /// How far it is from where b was expected [m].
  double jump_m = 0.0;
  /// Why it is not to be believed; empty where it is.
  std::string refusal;
};

/// Looks for b in the window round where it is expected in a: in plan, which also tells the second
/// best place, then by registration. Nothing where their grounds do not meet, or nothing that
/// stands up does.
[[nodiscard]] std::optional<SubmapMatch> match_submaps(const PlacedSubmap& a, const PlacedSubmap& b,
                                                       const Eigen::Isometry3d& T_a_b_expected,
                                                       const AlignmentWindow& window,
                                                       const SubmapMatchConfig& config);

}  // namespace stillmap
