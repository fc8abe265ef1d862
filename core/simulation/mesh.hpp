#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/simulation/materials.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// Triangles with a surface each, reflecting on both sides. Lengths in metres.
struct Mesh {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  /// One for each triangle.
  std::vector<Surface> surfaces;

  void add_triangle(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                    Surface surface);
  /// Corners in order along the outline.
  void add_quad(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                const Eigen::Vector3f& d, Surface surface);
  /// Appends a transformed copy of `part`.
  void append(const Mesh& part, const Eigen::Isometry3f& T_mesh_part);
};

/// Box between two corners, its edges along the axes.
void add_box(Mesh& mesh, const Eigen::Vector3f& low, const Eigen::Vector3f& high, Surface surface);

/// Upright block with a rectangular foot [x0, x1] x [-half_width, half_width] at height `z` and a
/// rectangular top; the shape of a car's cabin.
struct FrustumFace {
  float x0, x1, half_width, z;
};
void add_frustum(Mesh& mesh, const FrustumFace& foot, const FrustumFace& top, Surface sides,
                 Surface lid);

/// Convex side view in the x-z plane, extruded to y = -half_width .. half_width.
void add_prism(Mesh& mesh, std::span<const Eigen::Vector2f> profile_xz, float half_width,
               Surface surface);

/// Closed cylinder or cone from a to b.
struct Tube {
  Eigen::Vector3f a, b;
  float radius_a, radius_b;
  int sides = 8;
};
void add_tube(Mesh& mesh, const Tube& tube, Surface surface);

void add_ellipsoid(Mesh& mesh, const Eigen::Vector3f& centre, const Eigen::Vector3f& radii,
                   Surface surface);

// Defined apart from their callers: inlined, fused multiply-add would round differently in each of
// them, and the scans of a seed must keep their bits.

/// A triangle of random orientation, `leaf_m` in size.
void add_leaf(Mesh& mesh, const Eigen::Vector3f& centre, float leaf_m, Random& random,
              Surface surface);

struct Foliage {
  int leaves = 260;
  float leaf_m = 0.16F;
  /// Exponent of the relative depth: 1 fills the volume, towards 0 leaves gather on its surface.
  double depth_power = 0.4;
  Surface surface = Surface::leaves;
};
/// Leaves in an ellipsoid.
void add_leaf_ball(Mesh& mesh, const Eigen::Vector3f& centre, const Eigen::Vector3f& radii,
                   const Foliage& foliage, Random& random);

}  // namespace stillmap::simulation
