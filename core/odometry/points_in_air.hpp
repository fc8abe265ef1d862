#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace stillmap {

/// Of every point of a scan whether it hangs in the air near the lidar: rain, snow, dust, spray,
/// exhaust. Few of the rays through a cube of space end in it there, as they do on nothing that is
/// solid, poles and foliage included. Up to 12 m away, nearer for lidars of few points; where these
/// are so few that they may be anything, none is. Else, up to 20 m away, those are, too, that are
/// isolated (isolated_points.hpp): snow falls farther out and down to the ground. Not where most of
/// the first are not isolated, as of crops. `points_lidar` are in the lidar's frame [m], in any
/// order; empty for none.
[[nodiscard]] std::vector<bool> points_in_air(std::span<const Eigen::Vector3f> points_lidar);

}  // namespace stillmap
