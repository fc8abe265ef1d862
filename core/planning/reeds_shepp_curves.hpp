#pragma once

#include <functional>
#include <memory>

#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// A pose on a curve, and how the robot got there from the last one.
struct CurvePose {
  PlanarPose pose;
  /// Way from the last pose [m].
  double step_m = 0.0;
  bool is_reverse = false;
};

/// The shortest curves of a robot that drives forwards and backwards and cannot turn tighter than
/// a radius (J. Reeds, L. Shepp, "Optimal paths for a car that goes both forwards and backwards",
/// 1990). A robot that turns on the spot is one with a radius too small to matter.
class ReedsSheppCurves {
 public:
  /// @pre radius_m > 0
  explicit ReedsSheppCurves(double radius_m);
  ~ReedsSheppCurves();
  ReedsSheppCurves(ReedsSheppCurves&&) noexcept;
  ReedsSheppCurves& operator=(ReedsSheppCurves&&) noexcept;

  [[nodiscard]] double length_m(const PlanarPose& a, const PlanarPose& b) const;

  /// Visits poses from a (left out) to b, close enough that no point within `reach_m` of the pose
  /// moves more than `max_move_m` from one to the next, as long as `visit` says true.
  void visit_between(const PlanarPose& a, const PlanarPose& b, double max_move_m, double reach_m,
                     const std::function<bool(const CurvePose&)>& visit) const;

 private:
  struct Space;
  std::unique_ptr<Space> space_;
  double radius_m_;
};

}  // namespace stillmap
