#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/planning/planning_grid.hpp"
#include "core/planning/reeds_shepp_curves.hpp"

namespace stillmap {

/// A pose of a path that a robot drives.
struct PathPoint {
  CurvePose at;
  /// From the path's start to here.
  double cost = 0.0;
};

/// Whether and at what cost a robot drives from one pose to another on its shortest curve. Poses
/// are looked at as close together as check_path looks at them, and answers agree with it. Not
/// thread-safe.
class CollisionChecker {
 public:
  /// A metre backwards costs as much as `reverse_factor` forwards. The grid must outlive it.
  CollisionChecker(const PlanningGrid& grid, double reverse_factor);

  [[nodiscard]] const PlanningGrid& grid() const { return grid_; }
  /// Of the curve from a to b, whether free or not; never above its cost [m].
  [[nodiscard]] double length_m(const PlanarPose& a, const PlanarPose& b) const;
  /// Of the curve: metres times the cost of the cells under the pose; infinite when it is not free.
  [[nodiscard]] double cost(const PlanarPose& a, const PlanarPose& b) const;
  /// The curve's poses after a, costs counted from a; nothing when it is not free.
  [[nodiscard]] std::optional<std::vector<PathPoint>> connect(const PlanarPose& a,
                                                              const PlanarPose& b) const;

  /// Curves that were looked at so far: a measure of work that is the same on every machine.
  [[nodiscard]] std::uint64_t curves() const { return curves_seen_; }

 private:
  void visit(const PlanarPose& a, const PlanarPose& b,
             const std::function<bool(const CurvePose&)>& visit_pose) const;
  [[nodiscard]] double step_cost(const CurvePose& pose) const;

  const PlanningGrid& grid_;
  ReedsSheppCurves curves_;
  double reverse_factor_;
  mutable std::uint64_t curves_seen_ = 0;
  /// Planners ask for a curve's cost and then whether it is free.
  struct Answer {
    PlanarPose a;
    PlanarPose b;
    double cost = 0.0;
  };
  mutable std::optional<Answer> last_;
};

/// The turning radius that curves are made with: the profile's, or for a robot that turns on the
/// spot half a cell [m].
[[nodiscard]] double curve_radius_m(const RobotProfile& profile, double cell_m);

}  // namespace stillmap
