#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/simulation/ground_shape.hpp"

namespace stillmap::simulation {

/// A closed way on the ground. Positions are arc lengths in the map frame [m] and go round: any
/// number is one.
class Path {
 public:
  struct Spot {
    Eigen::Vector2d plan;
    /// Of travel, in plan coordinates [rad].
    double heading_plan;
  };

  /// @param corners_plan a closed polygon, finely sampled in its curves.
  Path(const GroundShape& ground, const std::vector<Eigen::Vector2d>& corners_plan);

  [[nodiscard]] double length_m() const { return length_m_; }
  [[nodiscard]] Spot at(double position_m) const;
  /// Of the way in the map, without sign [1/m].
  [[nodiscard]] double curvature(double position_m) const;
  /// Position nearest to a spot of the plan.
  [[nodiscard]] double nearest(const Eigen::Vector2d& spot_plan) const;
  /// `position_m` brought to 0 .. length.
  [[nodiscard]] double wrapped(double position_m) const;

 private:
  struct Sample {
    Eigen::Vector2d plan, along_plan;
    double curvature;
  };
  std::vector<Sample> samples_;
  double length_m_ = 0.0;
};

/// The city's route, or the route the other way round, shifted `offset_m` to the right of travel.
/// Turns have the route's radius, changed by the offset, or `turn_radius_m` where given.
[[nodiscard]] Path route_path(const GroundShape& ground, bool reversed, double offset_m,
                              std::optional<double> turn_radius_m = std::nullopt);

}  // namespace stillmap::simulation
