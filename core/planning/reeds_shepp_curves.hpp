#pragma once

#include <functional>
#include <memory>

#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// A pose on a curve.
struct CurvePose {
  PlanarPose pose;
  /// Distance from the previous pose along the curve [m].
  double step_m = 0.0;
  /// Whether the robot drives to it in reverse.
  bool is_reverse = false;
};

/// Shortest curves of a robot with a minimum turning radius that drives forwards and in reverse (J.
/// Reeds, L. Shepp, "Optimal paths for a car that goes both forwards and backwards", 1990). NOT
/// thread-safe.
class ReedsSheppCurves {
 public:
  /// @pre radius_m > 0
  explicit ReedsSheppCurves(double radius_m);
  ~ReedsSheppCurves();
  ReedsSheppCurves(ReedsSheppCurves&&) noexcept;
  ReedsSheppCurves& operator=(ReedsSheppCurves&&) noexcept;

  [[nodiscard]] double length_m(const PlanarPose& a, const PlanarPose& b) const;

  /// Visits poses from a (exclusive) to b, spaced so that no point within `reach_m` of the pose
  /// moves more than `max_move_m` from one to the next. Stops when `visit` returns false.
  void visit_between(const PlanarPose& a, const PlanarPose& b, double max_move_m, double reach_m,
                     const std::function<bool(const CurvePose&)>& visit) const;

 private:
  struct Space;
  std::unique_ptr<Space> space_;
  double radius_m_;
};

}  // namespace stillmap
