#include "core/odometry/object_clusters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>

namespace stillmap {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using enum SemanticClass;

struct Labelled {
  std::vector<Eigen::Vector3f> points;
  std::vector<SemanticClass> labels;

  void add(const Eigen::Vector3f& p, SemanticClass label) {
    points.push_back(p);
    labels.push_back(label);
  }
  /// A car's side of 4 m, a point every 0.2 m.
  void add_car(float x, float y, SemanticClass label = car) {
    for (int k = 0; k <= 20; ++k) add({x + 0.2F * static_cast<float>(k), y, 0.0F}, label);
  }
  [[nodiscard]] ObjectClusters objects(double gap_m = 0.5) const {
    return cluster_objects(points, labels, gap_m);
  }
};

TEST(ClusterObjects, TwoCarsApartAreTwoObjects) {
  Labelled scene;
  scene.add_car(5.0F, 2.0F);
  scene.add_car(5.0F, -2.0F);
  const ObjectClusters objects = scene.objects();
  EXPECT_EQ(objects.count, 2U);
  const std::set<std::int32_t> first(objects.of_point.begin(), objects.of_point.begin() + 21);
  const std::set<std::int32_t> second(objects.of_point.begin() + 21, objects.of_point.end());
  EXPECT_EQ(first.size(), 1U);
  EXPECT_EQ(second.size(), 1U);
  EXPECT_NE(first, second);
}

TEST(ClusterObjects, KnowsHowHighEachObjectIs) {
  Labelled scene;
  scene.add_car(5.0F, 2.0F);
  for (int k = 0; k <= 10; ++k) scene.add({5.0F, 10.0F, 0.3F * static_cast<float>(k) - 1.0F}, car);
  const ObjectClusters objects = scene.objects();
  ASSERT_EQ(objects.height_m.size(), 2U);
  EXPECT_FLOAT_EQ(objects.height_m[0], 0.0F);
  EXPECT_FLOAT_EQ(objects.height_m[1], 3.0F);
}

TEST(ClusterObjects, KnowsHowLongEachObjectIsAndWhetherItIsACar) {
  Labelled scene;
  for (int k = 0; k <= 120; ++k) scene.add({0.25F * static_cast<float>(k), 6.0F, 0.0F}, car);
  scene.add_car(5.0F, -3.0F, truck);
  const ObjectClusters objects = scene.objects();
  ASSERT_EQ(objects.count, 2U);
  EXPECT_NEAR(objects.length_m[0], 30.0F, 1.0F);
  EXPECT_NEAR(objects.length_m[1], 4.0F, 1.0F);
  EXPECT_TRUE(objects.is_car[0]);
  EXPECT_FALSE(objects.is_car[1]);
}

TEST(ClusterObjects, NeighbouringCubesAreOneObjectInEveryDirection) {
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) {
        Labelled scene;
        const Eigen::Vector3f middle(0.25F, 0.25F, 0.25F);
        scene.add(middle, car);
        scene.add(middle + 0.5F * Eigen::Vector3f(float(x), float(y), float(z)), car);
        EXPECT_EQ(scene.objects().count, 1U) << x << ' ' << y << ' ' << z;
      }
}

TEST(ClusterObjects, ACubeBetweenSeparates) {
  Labelled scene;
  scene.add({0.25F, 0.25F, 0.25F}, car);
  scene.add({1.25F, 0.25F, 0.25F}, car);
  EXPECT_EQ(scene.objects().count, 2U);
  EXPECT_EQ(scene.objects(1.0).count, 1U);
}

TEST(ClusterObjects, KindsNeverMix) {
  Labelled scene;
  for (const SemanticClass label : {car, person, bicyclist}) scene.add({1.0F, 1.0F, 1.0F}, label);
  EXPECT_EQ(scene.objects().count, 3U);
}

TEST(ClusterObjects, ClassesOfOneKindDoMix) {
  Labelled vehicles;
  for (const SemanticClass label : {car, truck, other_vehicle})
    vehicles.add({1.0F, 1.0F, 1.0F}, label);
  EXPECT_EQ(vehicles.objects().count, 1U) << "a network wavers between vehicles";
  Labelled riders;
  for (const SemanticClass label : {bicycle, motorcycle, bicyclist, motorcyclist})
    riders.add({1.0F, 1.0F, 1.0F}, label);
  EXPECT_EQ(riders.objects().count, 1U);
}

TEST(ClusterObjects, WhatCannotMoveIsNoObject) {
  Labelled scene;
  for (const SemanticClass label : {unlabeled, road, building, pole, vegetation})
    scene.add({1.0F, 1.0F, 1.0F}, label);
  const ObjectClusters objects = scene.objects();
  EXPECT_EQ(objects.count, 0U);
  EXPECT_THAT(objects.of_point, Each(ObjectClusters::none));
}

TEST(ClusterObjects, WithoutLabelsThereIsNone) {
  const std::vector<Eigen::Vector3f> points(3, Eigen::Vector3f::Zero());
  const ObjectClusters objects = cluster_objects(points, {}, 0.5);
  EXPECT_EQ(objects.count, 0U);
  EXPECT_THAT(objects.of_point,
              ElementsAre(ObjectClusters::none, ObjectClusters::none, ObjectClusters::none));
  EXPECT_EQ(cluster_objects({}, {}, 0.5).count, 0U);
}

TEST(ClusterObjects, EqualsGroupsFoundPlainly) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> coordinate(-6.0F, 6.0F);
  Labelled scene;
  for (int k = 0; k < 300; ++k) {
    const float x = coordinate(random);
    const float y = coordinate(random);
    scene.add({x, y, 0.0F}, random() % 2 == 0 ? car : person);
  }
  // Spread the lowest number over everything that touches until nothing changes.
  const std::size_t n = scene.points.size();
  const auto cube = [&](std::size_t i) -> Eigen::Vector3i {
    return (scene.points[i] * 2.0F).array().floor().cast<int>();
  };
  std::vector<std::size_t> group(n);
  for (std::size_t i = 0; i < n; ++i) group[i] = i;
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t j = 0; j < n; ++j) {
        const bool touch =
            scene.labels[i] == scene.labels[j] && (cube(i) - cube(j)).cwiseAbs().maxCoeff() <= 1;
        if (!touch || group[i] <= group[j]) continue;
        group[i] = group[j];
        changed = true;
      }
  }
  const ObjectClusters objects = scene.objects();
  EXPECT_EQ(objects.count, std::set<std::size_t>(group.begin(), group.end()).size());
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_EQ(objects.of_point[i] == objects.of_point[j], group[i] == group[j]);
}

}  // namespace
}  // namespace stillmap
