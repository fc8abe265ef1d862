#include "core/odometry/scan_features.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

namespace stillmap {
namespace {

/// A scan of points one metre apart, on `cars` cars of ten points each, the rest on buildings.
struct LabelledPoints {
  explicit LabelledPoints(std::size_t count, std::size_t cars) {
    for (std::size_t i = 0; i < count; ++i) {
      const bool is_car = i < 10 * cars;
      scan.points_lidar.emplace_back(static_cast<float>(i), 0.0F, 0.0F);
      labels.classes.push_back(is_car ? SemanticClass::car : SemanticClass::building);
      labels.confidence.push_back(0.25F);
      parts.features.surfaces.push_back(static_cast<std::uint32_t>(i));
      parts.features.planes.push_back(static_cast<std::uint32_t>(i));
      parts.objects.of_point.push_back(is_car ? static_cast<std::int32_t>(i / 10)
                                              : ObjectClusters::none);
    }
    parts.objects.count = cars;
    parts.objects.height_m.assign(cars, 1.5F);
    parts.objects.length_m.assign(cars, 4.0F);
    parts.objects.is_car.assign(cars, true);
    parts.motion_classes.assign(cars, MotionClass::undecided);
  }

  Scan scan{};
  SweepTimes sweep{};
  PointLabels labels{};
  ScanInParts parts{.scan = scan, .sweep = sweep, .labels = labels};
};

TEST(RegisteredFeatures, HaveTheirLabelsConfidence) {
  LabelledPoints points(200, 0);
  points.labels.confidence[1] = 3.0F;
  points.labels.confidence[2] = -1.0F;
  points.labels.confidence[3] = std::numeric_limits<float>::quiet_NaN();
  const FeatureSets sets = registered_features(points.parts, OdometryConfig{});
  ASSERT_EQ(sets.surfaces.size(), 200U);
  EXPECT_EQ(sets.surfaces[0].confidence, 0.25F);
  EXPECT_EQ(sets.surfaces[1].confidence, 1.0F);
  EXPECT_EQ(sets.surfaces[2].confidence, 0.0F);
  EXPECT_EQ(sets.surfaces[3].confidence, 0.0F);
}

TEST(RegisteredFeatures, AreSureWhereNothingSaysOtherwiseAndInThePapersMethod) {
  LabelledPoints points(200, 0);
  OdometryConfig paper;
  paper.paper_exact = true;
  EXPECT_EQ(registered_features(points.parts, paper).surfaces[0].confidence, 1.0F);
  points.labels.confidence.clear();
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces[0].confidence, 1.0F);
}

TEST(RegisteredFeatures, LeaveOutWhatCouldMoveUnlessLittleIsLeft) {
  LabelledPoints enough(200, 5);
  enough.parts.motion_classes[2] = MotionClass::parked;
  EXPECT_EQ(registered_features(enough.parts, OdometryConfig{}).surfaces.size(), 150U);
  LabelledPoints few(120, 5);
  few.parts.motion_classes[2] = MotionClass::parked;
  EXPECT_EQ(registered_features(few.parts, OdometryConfig{}).surfaces.size(), 80U)
      << "the parked car helps out";
  OdometryConfig none;
  none.weighting = Weighting::none;
  EXPECT_EQ(registered_features(enough.parts, none).surfaces.size(), 200U);
}

TEST(RegisteredFeatures, TakeAllThatWasNotSeenMovingWhereNearlyAllThatStandsUpCouldMove) {
  LabelledPoints points(200, 16);
  for (std::uint32_t i = 0; i < 200; ++i) points.parts.features.upright_points.push_back(i);
  points.parts.motion_classes[2] = MotionClass::moving;
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 190U);
  EXPECT_EQ(
      map_features(points.parts, std::vector<Motion>(200, Motion::stationary), {}).planes.size(),
      190U);
}

TEST(RegisteredFeatures, LeaveOutWhatCouldMoveWhereOthersStandBesideIt) {
  LabelledPoints points(200, 10);
  for (std::uint32_t i = 0; i < 200; ++i) points.parts.features.upright_points.push_back(i);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 100U);
  // What was seen moving is no reason to take what else could move.
  for (std::size_t k = 0; k < 8; ++k) points.parts.motion_classes[k] = MotionClass::moving;
  points.labels.classes.assign(200, SemanticClass::building);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 100U);
}

TEST(RegisteredFeatures, LeaveOutWhatCouldMoveWhereHardlyAnyPointsStandUp) {
  LabelledPoints points(200, 2);
  for (std::uint32_t i = 0; i < 21; ++i) points.parts.features.upright_points.push_back(i);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 180U);
}

TEST(RegisteredFeatures, DoNotCountTheGroundUnderCarsAsStandingUp) {
  LabelledPoints points(200, 10);
  for (std::uint32_t i = 0; i < 200; ++i) points.parts.features.upright_points.push_back(i);
  std::fill(points.labels.classes.begin() + 110, points.labels.classes.end(), SemanticClass::road);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 200U);
}

TEST(RegisteredFeatures, DoNotCountHousesThatAreTooFarOffForSurfaces) {
  LabelledPoints points(200, 3);
  for (std::uint32_t i = 0; i < 200; ++i) points.parts.features.upright_points.push_back(i);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 170U);
  points.parts.surfaces_reach_m = 32.0F;
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 200U);
}

TEST(RegisteredFeatures, TakeTheRoadWhereLabelsSayThatItCouldMove) {
  LabelledPoints points(200, 10);
  for (std::uint32_t i = 0; i < 110; ++i) points.parts.features.level_points.push_back(i);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 200U);
}

TEST(RegisteredFeatures, DoNotChangeToAndFroBetweenOneScanAndTheNext) {
  LabelledPoints points(300, 20);
  for (std::uint32_t i = 0; i < 300; ++i) points.parts.features.upright_points.push_back(i);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 100U);
  points.parts.movable = MovableUse::not_moving;
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 300U);
  EXPECT_EQ(fixed_features(points.parts, OdometryConfig{}).surfaces.size(), 100U);
}

/// A long wall along x, on which `wall` of the points are, and cars of which one shows its side and
/// the next one its rear.
LabelledPoints before_a_wall(std::size_t wall, std::size_t cars) {
  LabelledPoints points(wall + 10 * cars, cars);
  for (std::uint32_t i = 0; i < points.scan.size(); ++i) {
    points.parts.features.upright_points.push_back(i);
    const bool is_rear = i < 10 * cars && (i / 10) % 2 == 0;
    points.parts.upright_tangents.push_back(is_rear ? Eigen::Vector3f::UnitY()
                                                    : Eigen::Vector3f::UnitX());
  }
  return points;
}

TEST(RegisteredFeatures, TakeAllThatWasNotSeenMovingWhereItAloneTellsTheWayAlongAWall) {
  LabelledPoints points = before_a_wall(200, 10);
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 300U);
  EXPECT_EQ(points.parts.movable, MovableUse::not_moving);
  LabelledPoints moving = before_a_wall(200, 10);
  for (std::size_t k = 0; k < 10; ++k) moving.parts.motion_classes[k] = MotionClass::moving;
  EXPECT_EQ(registered_features(moving.parts, OdometryConfig{}).surfaces.size(), 200U);
}

TEST(RegisteredFeatures, LeaveOutWhatCouldMoveWhereTheRestTellsTheWayAlongAWall) {
  LabelledPoints points = before_a_wall(200, 10);
  // Poles, which no ring goes straight on over.
  for (std::size_t i = 100; i < 160; ++i) points.parts.upright_tangents[i].setZero();
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 200U);
  points.parts.movable = MovableUse::not_moving;
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 300U)
      << "less may be left before cars are taken up than when they are let go";
}

TEST(UprightTangents, AreLookedAtWhereAGoodPartCouldMove) {
  LabelledPoints points(200, 10);
  for (std::uint32_t i = 0; i < 200; ++i) points.parts.features.upright_points.push_back(i);
  find_upright_tangents(points.parts, OdometryConfig{});
  EXPECT_TRUE(points.parts.upright_tangents.empty()) << "rings are not known";
  points.scan.ring.assign(200, 0);
  find_upright_tangents(points.parts, OdometryConfig{});
  EXPECT_EQ(points.parts.upright_tangents.size(), 200U);
  LabelledPoints few(200, 2);
  few.scan.ring.assign(200, 0);
  for (std::uint32_t i = 0; i < 200; ++i) few.parts.features.upright_points.push_back(i);
  find_upright_tangents(few.parts, OdometryConfig{});
  EXPECT_TRUE(few.parts.upright_tangents.empty());
}

TEST(ParkedShare, IsThatOfTheObjectsThatWereNotSeenMoving) {
  LabelledPoints points(200, 10);
  EXPECT_EQ(parked_share(points.parts), 0.0);
  for (std::uint32_t i = 0; i < 200; ++i) points.parts.features.upright_points.push_back(i);
  EXPECT_EQ(parked_share(points.parts), 0.0);
  points.parts.motion_classes[0] = points.parts.motion_classes[1] = MotionClass::moving;
  points.parts.motion_classes[2] = points.parts.motion_classes[3] = MotionClass::parked;
  EXPECT_EQ(parked_share(points.parts), 0.25);
}

TEST(RegisteredFeatures, TakeObjectsThatAreTallerThanAnyVehicle) {
  LabelledPoints points(200, 5);
  points.parts.objects.height_m[0] = 12.0F;
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 160U);
}

TEST(RegisteredFeatures, TakeCarsThatAreLongerThanAnyCar) {
  LabelledPoints points(200, 5);
  points.parts.objects.length_m[0] = 30.0F;
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 160U);
  points.parts.objects.is_car[0] = false;
  EXPECT_EQ(registered_features(points.parts, OdometryConfig{}).surfaces.size(), 150U) << "a tram";
}

TEST(MapFeatures, LeaveOutWhatMoves) {
  LabelledPoints points(200, 0);
  std::vector<Motion> motion(200, Motion::stationary);
  motion[7] = Motion::highly_dynamic;
  motion[8] = Motion::semi_static;
  EXPECT_EQ(map_features(points.parts, motion, OdometryConfig{}).planes.size(), 199U);
}

}  // namespace
}  // namespace stillmap
