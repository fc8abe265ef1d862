#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/planning/planning_grid.hpp"
#include "core/planning/reeds_shepp_curves.hpp"

namespace stillmap {

/// A pose of a path.
struct PathPoint {
  CurvePose at;
  /// Cost from the path's start.
  double cost = 0.0;
};

/// Collision check and cost of the shortest curve between two poses. Poses are tested at the
/// spacing of check_path, so that results agree with it. NOT thread-safe.
class CollisionChecker {
 public:
  /// A metre in reverse costs `reverse_factor` times one forwards. The grid must outlive the
  /// checker.
  CollisionChecker(const PlanningGrid& grid, double reverse_factor);

  [[nodiscard]] const PlanningGrid& grid() const { return grid_; }
  /// Length of the curve from a to b, whether free or not; at most its cost [m].
  [[nodiscard]] double length_m(const PlanarPose& a, const PlanarPose& b) const;
  /// Metres times cost factor of the cells under the poses; infinite if the curve is not free.
  [[nodiscard]] double cost(const PlanarPose& a, const PlanarPose& b) const;
  /// The curve's poses after a, with costs from a; nothing if it is not free.
  [[nodiscard]] std::optional<std::vector<PathPoint>> connect(const PlanarPose& a,
                                                              const PlanarPose& b) const;

  /// Number of curves checked so far: a measure of work that does not depend on the machine.
  [[nodiscard]] std::uint64_t curves() const { return checked_curves_; }

 private:
  void visit(const PlanarPose& a, const PlanarPose& b,
             const std::function<bool(const CurvePose&)>& visit_pose) const;
  [[nodiscard]] double step_cost(const CurvePose& pose) const;

  const PlanningGrid& grid_;
  ReedsSheppCurves curves_;
  double reverse_factor_;
  mutable std::uint64_t checked_curves_ = 0;
  /// Cache of one curve: planners ask for its cost and then whether it is free.
  struct Answer {
    PlanarPose a;
    PlanarPose b;
    double cost = 0.0;
  };
  mutable std::optional<Answer> last_;
};

/// Radius of the curves: the profile's minimum turning radius, but at least half a cell, which
/// stands for turning on the spot [m].
[[nodiscard]] double curve_radius_m(const RobotProfile& profile, double cell_m);

}  // namespace stillmap
