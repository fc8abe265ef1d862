#include "core/simulation/mesh.hpp"

#include <cmath>
#include <numbers>

namespace stillmap::simulation {
namespace {

using Eigen::Vector3f;

// Unit vector perpendicular to `axis`, at `step` of `steps` round it.
Vector3f rim(const Vector3f& axis, int step, int steps) {
  const Vector3f side = axis.unitOrthogonal();
  const float angle =
      2.0F * std::numbers::pi_v<float> * static_cast<float>(step) / static_cast<float>(steps);
  return std::cos(angle) * side + std::sin(angle) * axis.cross(side);
}

Vector3f on_sphere(int stack, int stacks, int slice, int slices) {
  constexpr float pi = std::numbers::pi_v<float>;
  const float polar = pi * static_cast<float>(stack) / static_cast<float>(stacks);
  const float azimuth = 2.0F * pi * static_cast<float>(slice) / static_cast<float>(slices);
  return {std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
          std::cos(polar)};
}

Vector3f random_direction(Random& random) {
  const double z = random.uniform(-1.0, 1.0);
  const double angle = random.uniform(0.0, 2.0 * std::numbers::pi);
  const double ring = std::sqrt(1.0 - z * z);
  return Eigen::Vector3d(ring * std::cos(angle), ring * std::sin(angle), z).cast<float>();
}

}  // namespace

void Mesh::add_triangle(const Vector3f& a, const Vector3f& b, const Vector3f& c, Surface surface) {
  const auto first = static_cast<std::uint32_t>(vertices.size());
  vertices.insert(vertices.end(), {a, b, c});
  triangles.push_back({first, first + 1, first + 2});
  surfaces.push_back(surface);
}

void Mesh::add_quad(const Vector3f& a, const Vector3f& b, const Vector3f& c, const Vector3f& d,
                    Surface surface) {
  const auto first = static_cast<std::uint32_t>(vertices.size());
  vertices.insert(vertices.end(), {a, b, c, d});
  triangles.push_back({first, first + 1, first + 2});
  triangles.push_back({first, first + 2, first + 3});
  surfaces.insert(surfaces.end(), 2, surface);
}

void Mesh::append(const Mesh& part, const Eigen::Isometry3f& T_mesh_part) {
  const auto first = static_cast<std::uint32_t>(vertices.size());
  for (const Vector3f& vertex : part.vertices) vertices.push_back(T_mesh_part * vertex);
  for (const auto& [a, b, c] : part.triangles)
    triangles.push_back({first + a, first + b, first + c});
  surfaces.insert(surfaces.end(), part.surfaces.begin(), part.surfaces.end());
}

void add_box(Mesh& mesh, const Vector3f& low, const Vector3f& high, Surface surface) {
  Mesh box;
  const Vector3f half = 0.5F * (high - low);
  add_frustum(box, {-half.x(), half.x(), half.y(), -half.z()},
              {-half.x(), half.x(), half.y(), half.z()}, surface, surface);
  mesh.append(box, Eigen::Isometry3f(Eigen::Translation3f(0.5F * (low + high))));
}

void add_frustum(Mesh& mesh, const FrustumFace& foot, const FrustumFace& top, Surface sides,
                 Surface lid) {
  const auto corners = [](const FrustumFace& f) {
    return std::array<Vector3f, 4>{{{f.x0, -f.half_width, f.z},
                                    {f.x1, -f.half_width, f.z},
                                    {f.x1, f.half_width, f.z},
                                    {f.x0, f.half_width, f.z}}};
  };
  const auto low = corners(foot);
  const auto high = corners(top);
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t next = (i + 1) % 4;
    mesh.add_quad(low[i], low[next], high[next], high[i], sides);
  }
  mesh.add_quad(low[0], low[1], low[2], low[3], sides);
  mesh.add_quad(high[0], high[1], high[2], high[3], lid);
}

void add_prism(Mesh& mesh, std::span<const Eigen::Vector2f> profile_xz, float half_width,
               Surface surface) {
  const auto at = [&](std::size_t i, float y) {
    const Eigen::Vector2f& p = profile_xz[i % profile_xz.size()];
    return Vector3f(p.x(), y, p.y());
  };
  for (std::size_t i = 0; i < profile_xz.size(); ++i) {
    mesh.add_quad(at(i, -half_width), at(i + 1, -half_width), at(i + 1, half_width),
                  at(i, half_width), surface);
    mesh.add_triangle(at(0, -half_width), at(i, -half_width), at(i + 1, -half_width), surface);
    mesh.add_triangle(at(0, half_width), at(i, half_width), at(i + 1, half_width), surface);
  }
}

void add_tube(Mesh& mesh, const Tube& tube, Surface surface) {
  const Vector3f axis = (tube.b - tube.a).normalized();
  for (int i = 0; i < tube.sides; ++i) {
    const Vector3f u = rim(axis, i, tube.sides);
    const Vector3f v = rim(axis, i + 1, tube.sides);
    const Vector3f a_u = tube.a + tube.radius_a * u;
    const Vector3f a_v = tube.a + tube.radius_a * v;
    const Vector3f b_u = tube.b + tube.radius_b * u;
    const Vector3f b_v = tube.b + tube.radius_b * v;
    mesh.add_quad(a_u, a_v, b_v, b_u, surface);
    mesh.add_triangle(tube.a, a_u, a_v, surface);
    mesh.add_triangle(tube.b, b_u, b_v, surface);
  }
}

void add_ellipsoid(Mesh& mesh, const Vector3f& centre, const Vector3f& radii, Surface surface) {
  constexpr int stacks = 5;
  constexpr int slices = 8;
  const auto at = [&](int stack, int slice) -> Vector3f {
    return centre + radii.cwiseProduct(on_sphere(stack, stacks, slice, slices));
  };
  for (int stack = 0; stack < stacks; ++stack) {
    for (int slice = 0; slice < slices; ++slice) {
      mesh.add_quad(at(stack, slice), at(stack + 1, slice), at(stack + 1, slice + 1),
                    at(stack, slice + 1), surface);
    }
  }
}

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
