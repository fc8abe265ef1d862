#include "core/planning/reeds_shepp_curves.hpp"

#include <ompl/base/spaces/ReedsSheppStateSpace.h>

#include <cmath>

namespace stillmap {
namespace {

namespace ob = ompl::base;
using Segment = ob::ReedsSheppStateSpace::ReedsSheppPathSegmentType;

constexpr int segments = 5;

/// A pose in units of the turning radius.
struct UnitPose {
  double x = 0.0;
  double y = 0.0;
  double heading_rad = 0.0;
};

/// The pose after a signed distance of `t` radii along a segment.
UnitPose moved(const UnitPose& from, Segment type, double t) {
  const double phi = from.heading_rad;
  switch (type) {
    case ob::ReedsSheppStateSpace::RS_LEFT:
      return {from.x + std::sin(phi + t) - std::sin(phi),
              from.y - std::cos(phi + t) + std::cos(phi), phi + t};
    case ob::ReedsSheppStateSpace::RS_RIGHT:
      return {from.x - std::sin(phi - t) + std::sin(phi),
              from.y + std::cos(phi - t) - std::cos(phi), phi - t};
    case ob::ReedsSheppStateSpace::RS_STRAIGHT:
      return {from.x + t * std::cos(phi), from.y + t * std::sin(phi), phi};
    case ob::ReedsSheppStateSpace::RS_NOP:
      break;
  }
  return from;
}

}  // namespace

struct ReedsSheppCurves::Space {
  explicit Space(double radius_m) : curves(radius_m), a(&curves), b(&curves) {}

  [[nodiscard]] ob::ReedsSheppStateSpace::ReedsSheppPath path(const PlanarPose& from,
                                                              const PlanarPose& to) {
    set(a, from);
    set(b, to);
    return curves.reedsShepp(a.state, b.state);
  }

  /// Owns a state of the space.
  struct State {
    explicit State(ob::ReedsSheppStateSpace* owner)
        : space(owner), state(owner->allocState()->as<ob::SE2StateSpace::StateType>()) {}
    ~State() { space->freeState(state); }
    State(const State&) = delete;
    State& operator=(const State&) = delete;
    ob::ReedsSheppStateSpace* space;
    ob::SE2StateSpace::StateType* state;
  };
  static void set(State& state, const PlanarPose& pose) {
    state.state->setXY(pose.position_map.x(), pose.position_map.y());
    state.state->setYaw(pose.heading_rad);
  }

  ob::ReedsSheppStateSpace curves;
  State a;
  State b;
};

ReedsSheppCurves::ReedsSheppCurves(double radius_m)
    : space_(std::make_unique<Space>(radius_m)), radius_m_(radius_m) {}
ReedsSheppCurves::~ReedsSheppCurves() = default;
ReedsSheppCurves::ReedsSheppCurves(ReedsSheppCurves&&) noexcept = default;
ReedsSheppCurves& ReedsSheppCurves::operator=(ReedsSheppCurves&&) noexcept = default;

double ReedsSheppCurves::length_m(const PlanarPose& a, const PlanarPose& b) const {
  return radius_m_ * space_->path(a, b).length();
}

void ReedsSheppCurves::visit_between(const PlanarPose& a, const PlanarPose& b, double max_move_m,
                                     double reach_m,
                                     const std::function<bool(const CurvePose&)>& visit) const {
  const auto path = space_->path(a, b);
  UnitPose from{0.0, 0.0, a.heading_rad};
  double left = path.length();
  for (int i = 0; i < segments; ++i) {
    const Segment type = path.type_[i];
    const double length = path.length_[i];
    if (type == ob::ReedsSheppStateSpace::RS_NOP || length == 0.0) continue;
    const double turned_m = type == ob::ReedsSheppStateSpace::RS_STRAIGHT ? 0.0 : reach_m;
    const double moved_m = std::abs(length) * (radius_m_ + turned_m);
    const int count = std::max(1, static_cast<int>(std::ceil(moved_m / max_move_m)));
    left -= std::abs(length);
    for (int k = 1; k <= count; ++k) {
      const UnitPose at = moved(from, type, length * k / count);
      // The curve's end, without rounding errors.
      const bool is_end = k == count && left < 1e-9;
      const PlanarPose pose =
          is_end ? b
                 : PlanarPose{a.position_map + radius_m_ * Eigen::Vector2d(at.x, at.y),
                              at.heading_rad};
      if (!visit({pose, radius_m_ * std::abs(length) / count, length < 0.0})) return;
    }
    from = moved(from, type, length);
  }
}

}  // namespace stillmap
