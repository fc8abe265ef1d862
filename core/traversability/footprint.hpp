#pragma once

#include <Eigen/Core>
#include <functional>

#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Where a robot stands: the point that its profile's poses speak of, and its heading from x
/// towards y.
struct PlanarPose {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
};

/// Calls `visit(CellIndex)` for the cells that a robot at `pose` covers: those whose centre is in
/// its footprint made half a cell larger on every side, so that none that it touches is left out
/// but at its corners. @pre the view's cell_of(pose.position_map) is a cell.
void visit_footprint(const TraversabilityView& view, const PlanarPose& pose,
                     const std::function<void(CellIndex)>& visit);

}  // namespace stillmap
