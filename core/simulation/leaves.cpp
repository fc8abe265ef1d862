#include "core/simulation/leaves.hpp"

#include <cmath>
#include <numbers>

namespace stillmap::simulation {
namespace {

using Eigen::Vector3f;

Vector3f random_direction(Random& random) {
  const double z = random.uniform(-1.0, 1.0);
  const double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
  const double ring = std::sqrt(1.0 - z * z);
  return Eigen::Vector3d(ring * std::cos(angle), ring * std::sin(angle), z).cast<float>();
}

}  // namespace

void add_leaf(Mesh& mesh, const Vector3f& centre, float leaf_m, Random& random, Surface surface) {
  const Vector3f u = random_direction(random);
  const Vector3f v = u.unitOrthogonal();
  mesh.add_triangle(centre + leaf_m * u, centre - 0.5F * leaf_m * u + 0.8F * leaf_m * v,
                    centre - 0.5F * leaf_m * u - 0.8F * leaf_m * v, surface);
}

void add_leaf_ball(Mesh& mesh, const Vector3f& centre, const Vector3f& radii,
                   const Foliage& foliage, Random& random) {
  for (int i = 0; i < foliage.leaves; ++i) {
    const auto depth = static_cast<float>(std::pow(random.uniform(), foliage.depth_power));
    add_leaf(mesh, centre + depth * radii.cwiseProduct(random_direction(random)), foliage.leaf_m,
             random, foliage.surface);
  }
}

}  // namespace stillmap::simulation
