#include "core/simulation/mesh.hpp"

#include <gmock/gmock.h>

#include <numbers>

#include "core/simulation/city_shapes.hpp"
#include "core/simulation/object_shapes.hpp"

namespace stillmap::simulation {
namespace {

double area(const Mesh& mesh) {
  double sum = 0.0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f& origin = mesh.vertices[a];
    sum += 0.5 * (mesh.vertices[b] - origin).cross(mesh.vertices[c] - origin).norm();
  }
  return sum;
}

Eigen::AlignedBox3f bounds(const Mesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  return box;
}

TEST(Mesh, BoxHasItsSurfaceArea) {
  Mesh mesh;
  add_box(mesh, {1, 2, 3}, {2, 4, 6}, Surface::paint);
  EXPECT_NEAR(area(mesh), 2.0 * (1 * 2 + 2 * 3 + 1 * 3), 1e-5);
  EXPECT_TRUE(bounds(mesh).isApprox(
      Eigen::AlignedBox3f(Eigen::Vector3f(1, 2, 3), Eigen::Vector3f(2, 4, 6))));
}

TEST(Mesh, TubeHasTheAreaOfItsPrism) {
  Mesh mesh;
  add_tube(mesh, {{0, 0, 0}, {0, 0, 2}, 0.5F, 0.5F, 64}, Surface::pole);
  const double pi = std::numbers::pi;
  EXPECT_NEAR(area(mesh), 2.0 * pi * 0.5 * 2.0 + 2.0 * pi * 0.25, 0.02);
}

TEST(Mesh, EllipsoidOfEqualRadiiIsNearlyASphere) {
  Mesh mesh;
  add_ellipsoid(mesh, {0, 0, 1}, {1, 1, 1}, Surface::skin);
  EXPECT_NEAR(area(mesh), 4.0 * std::numbers::pi, 2.2);
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    EXPECT_NEAR((vertex - Eigen::Vector3f(0, 0, 1)).norm(), 1.0F, 1e-5F);
  }
}

TEST(Mesh, AppendMovesTheCopyAndKeepsItsSurfaces) {
  Mesh box;
  add_box(box, {0, 0, 0}, {1, 1, 1}, Surface::hedge);
  Mesh mesh = box;
  mesh.append(box, Eigen::Isometry3f(Eigen::Translation3f(10, 0, 0)));
  EXPECT_EQ(mesh.triangles.size(), 2 * box.triangles.size());
  EXPECT_EQ(mesh.surfaces.size(), mesh.triangles.size());
  EXPECT_NEAR(area(mesh), 12.0, 1e-5);
  EXPECT_FLOAT_EQ(bounds(mesh).max().x(), 11.0F);
}

class EveryObject : public testing::TestWithParam<ObjectKind> {};

TEST_P(EveryObject, StandsOnTheGroundInItsFootprint) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Variety variety = seed % 2 == 0 ? Variety::plain : Variety::any;
    const ObjectShape object = make_object(GetParam(), Random(seed), variety);
    const Eigen::AlignedBox3f box = bounds(object.mesh);
    EXPECT_GT(box.min().z(), -0.05F);
    EXPECT_LT(box.min().z(), 0.1F);
    EXPECT_LE(2.0F * box.max().x(), object.length_m + 1e-5F);
    EXPECT_GE(2.0F * box.min().x(), -object.length_m - 1e-5F);
    EXPECT_LE(2.0F * box.max().y(), object.width_m + 1e-5F);
    EXPECT_LT(object.width_m, 2.7F);
    EXPECT_LT(object.length_m, 13.0F);
    EXPECT_EQ(object.mesh.surfaces.size(), object.mesh.triangles.size());
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, EveryObject,
                         testing::Values(ObjectKind::car, ObjectKind::truck, ObjectKind::bus,
                                         ObjectKind::bicycle, ObjectKind::motorcycle,
                                         ObjectKind::bicyclist, ObjectKind::motorcyclist,
                                         ObjectKind::person, ObjectKind::other_vehicle));

TEST(Building, HasReliefDeeperThanTheLidarsNoise) {
  const BuildingPlan plan{.width_m = 12,
                          .depth_m = 9,
                          .floors = 3,
                          .gabled = false,
                          .balconies = true,
                          .wall = Surface::brick};
  const Mesh house = make_building(plan, Random(3));
  std::vector<float> depths;
  for (const Eigen::Vector3f& vertex : house.vertices) {
    if (vertex.y() < -3.5F) depths.push_back(vertex.y());
  }
  const auto [front, back] = std::ranges::minmax(depths);
  EXPECT_LT(front, -4.5F - 1.0F) << "balconies stand out";
  EXPECT_GT(back, -4.5F + 0.1F) << "windows lie back";
  EXPECT_THAT(house.surfaces, testing::Contains(Surface::window));
}

TEST(Tree, LeavesHoles) {
  const Mesh tree = make_tree(Random(5));
  EXPECT_THAT(tree.surfaces, testing::Contains(Surface::bark));
  // Leaves' total area, seen from one side, does not cover the crown's outline twice.
  Mesh leaves = tree;
  leaves.triangles.clear();
  for (std::size_t i = 0; i < tree.triangles.size(); ++i) {
    if (tree.surfaces[i] == Surface::leaves) leaves.triangles.push_back(tree.triangles[i]);
  }
  const Eigen::Vector3f size = bounds(tree).sizes();
  EXPECT_LT(0.5 * area(leaves), 2.0 * size.x() * size.z());
  EXPECT_GT(0.5 * area(leaves), 0.2 * size.x() * size.z());
}

}  // namespace
}  // namespace stillmap::simulation
