#include "core/simulation/ray_scene.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "core/simulation/object_shapes.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector3f;

// Moeller and Trumbore, in double precision.
std::optional<double> distance_to(const Mesh& mesh, std::size_t triangle,
                                  const Eigen::Vector3d& origin, const Eigen::Vector3d& way) {
  const auto& [ia, ib, ic] = mesh.triangles[triangle];
  const Eigen::Vector3d a = mesh.vertices[ia].cast<double>();
  const Eigen::Vector3d ab = mesh.vertices[ib].cast<double>() - a;
  const Eigen::Vector3d ac = mesh.vertices[ic].cast<double>() - a;
  const Eigen::Vector3d p = way.cross(ac);
  const double det = ab.dot(p);
  if (std::abs(det) < 1e-12) return std::nullopt;
  const double u = (origin - a).dot(p) / det;
  const Eigen::Vector3d q = (origin - a).cross(ab);
  const double v = way.dot(q) / det;
  const double t = ac.dot(q) / det;
  if (u < 0.0 || v < 0.0 || u + v > 1.0 || t < 0.0) return std::nullopt;
  return t;
}

double brute_force(const Mesh& mesh, const Eigen::Vector3d& origin, const Eigen::Vector3d& way) {
  double best = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    best = std::min(best, distance_to(mesh, i, origin, way).value_or(best));
  }
  return best;
}

TEST(RayScene, AgreesWithBruteForceOnABicycle) {
  const ObjectShape bicycle = make_object(ObjectKind::bicyclist, Random(1));
  Eigen::Isometry3d T_map_body(Eigen::Translation3d(2, 1, 0));
  T_map_body.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()));
  const std::array<StandingMesh, 1> standing{{{0, T_map_body}}};
  const RayScene scene({&bicycle.mesh}, standing);
  const RaySnapshot snapshot = scene.with({});
  Random random(2);
  int hits = 0;
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d goal(random.uniform(1.2, 2.8), random.uniform(0.2, 1.8),
                               random.uniform(0.0, 1.8));
    const Eigen::Vector3d origin(-3, -2, 1);
    const Eigen::Vector3d way = (goal - origin).normalized();
    const auto hit = snapshot.cast({origin.cast<float>(), way.cast<float>(), 50.0F});
    const Eigen::Isometry3d T_body_map = T_map_body.inverse();
    const double truth = brute_force(bicycle.mesh, T_body_map * origin, T_body_map.linear() * way);
    EXPECT_EQ(hit.has_value(), std::isfinite(truth)) << i;
    if (!hit || !std::isfinite(truth)) continue;
    ++hits;
    EXPECT_NEAR(hit->range_m, truth, 1e-3);
    EXPECT_EQ(hit->body, 0U);
  }
  EXPECT_GT(hits, 50);
}

TEST(RayScene, MovingBodyIsWhereItIsAtTheRaysTime) {
  Mesh box;
  add_box(box, {-0.5F, -0.5F, -0.5F}, {0.5F, 0.5F, 0.5F}, Surface::paint);
  const RayScene scene({&box}, {});
  const std::array<MovingMesh, 1> moving{{{0, Eigen::Isometry3d(Eigen::Translation3d(10, 0, 0)),
                                           Eigen::Isometry3d(Eigen::Translation3d(14, 0, 0))}}};
  const RaySnapshot snapshot = scene.with(moving);
  for (const float time : {0.0F, 0.25F, 0.5F, 1.0F}) {
    const auto hit = snapshot.cast({Vector3f::Zero(), Vector3f::UnitX(), 50.0F, time});
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->range_m, 9.5F + 4.0F * time, 1e-4F);
    EXPECT_NEAR(hit->cos_incidence, 1.0F, 1e-5F);
    EXPECT_EQ(hit->surface, Surface::paint);
  }
}

TEST(RayScene, RaysEndAtTheirRange) {
  Mesh box;
  add_box(box, {-0.5F, -0.5F, -0.5F}, {0.5F, 0.5F, 0.5F}, Surface::paint);
  const std::array<StandingMesh, 1> standing{
      {{0, Eigen::Isometry3d(Eigen::Translation3d(30, 0, 0))}}};
  const RayScene scene({&box}, standing);
  EXPECT_FALSE(scene.with({}).cast({Vector3f::Zero(), Vector3f::UnitX(), 20.0F}));
  EXPECT_TRUE(scene.with({}).cast({Vector3f::Zero(), Vector3f::UnitX(), 40.0F}));
  EXPECT_FALSE(scene.with({}).cast({Vector3f::Zero(), Vector3f::UnitY(), 40.0F}));
}

}  // namespace
}  // namespace stillmap::simulation
