#pragma once

#include <Eigen/Core>

#include "core/simulation/mesh.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// Single leaves (triangles of any direction), `leaf_m` in size.
struct Foliage {
  int leaves = 260;
  float leaf_m = 0.16F;
  /// 1: evenly in the whole volume; towards 0: more and more on its surface.
  double depth_power = 0.4;
  Surface surface = Surface::leaves;
};

/// A leaf at `centre`.
void add_leaf(Mesh& mesh, const Eigen::Vector3f& centre, float leaf_m, Random& random,
              Surface surface);

/// Leaves in an ellipsoid.
void add_leaf_ball(Mesh& mesh, const Eigen::Vector3f& centre, const Eigen::Vector3f& radii,
                   const Foliage& foliage, Random& random);

}  // namespace stillmap::simulation
