#pragma once

#include <Eigen/Core>
#include <span>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// Votes of neighbours, and pixels that see both, carry the class of a vehicle to the ground beside
/// its wheels and below its body. Points of cars, trucks and other vehicles that lie less than
/// 0.02 m above the ground, or up to 0.2 m below it, take its class: of the points of ground within
/// a square metre and the eight around it, the one with most votes, each point voting with its
/// confidence; these votes divided by the number of points are their confidence. The ground is the
/// plane through these points; where they are fewer than five, or lie 0.06 m off it in the mean,
/// nothing changes. `points` along axes in which the ground is level; those farther than a million
/// metres from the lidar stay. `labels` is as long as `points`.
void vote_below_vehicles(std::span<const Eigen::Vector3f> points, PointLabels& labels);

}  // namespace stillmap
