#include "core/graph/submap.hpp"

#include <gtest/gtest.h>

#include "core/graph/earlier_map.hpp"
#include "core/graph/submap_match.hpp"
#include "core/graph/submap_registration.hpp"
#include "core/odometry/se3.hpp"
#include "tests/graph/street_world.hpp"

namespace stillmap {
namespace {

TEST(SubmapBuilder, PointsComeInTheUprightFrameOfTheKey) {
  SubmapBuilder builder({.min_scans = 1});
  LabelledScan scan;
  scan.scan.points_lidar = {{5.0F, 0.0F, 0.0F}};
  scan.motion = {Motion::stationary};
  PoseTangent xi;
  xi << 10.0, 20.0, 3.0, 0.1, 0.2, 1.0;
  const Eigen::Isometry3d T_odom_lidar = motion_of(xi);
  builder.add(scan, T_odom_lidar);
  const Submap submap = builder.take(T_odom_lidar);
  ASSERT_EQ(submap.points_submap.size(), 1U);
  const Eigen::Vector3d expected = submap.T_submap_key * Eigen::Vector3d(5, 0, 0);
  EXPECT_LT((submap.points_submap[0].cast<double>() - expected).norm(), 1e-5);
  // Its z is that of odom.
  const Eigen::Vector3d up_key = T_odom_lidar.linear().transpose() * Eigen::Vector3d::UnitZ();
  EXPECT_LT((submap.T_submap_key.linear() * up_key - Eigen::Vector3d::UnitZ()).norm(), 1e-9);
  EXPECT_NEAR((submap.T_submap_key.linear() * Eigen::Vector3d::UnitX()).y(), 0.0, 1e-9);
  EXPECT_TRUE(builder.empty());
}

TEST(SubmapBuilder, LeavesOutWhatMovesOrIsFarOrWasSeenOnce) {
  SubmapBuilder builder({.max_range_m = 30.0, .min_scans = 2});
  LabelledScan scan;
  scan.scan.points_lidar = {{5, 0, 0}, {6, 3, 0}, {50, 0, 0}, {7, -3, 0}};
  scan.motion = {Motion::stationary, Motion::highly_dynamic, Motion::stationary,
                 Motion::stationary};
  scan.labels.classes = {SemanticClass::building, SemanticClass::building, SemanticClass::building,
                         SemanticClass::car};
  scan.labels.confidence.assign(4, 1.0F);
  builder.add(scan, Eigen::Isometry3d::Identity());
  scan.scan.points_lidar[0].x() -= 1.0F;
  builder.add(scan, Eigen::Isometry3d(Eigen::Translation3d(1, 0, 0)));
  const Submap submap = builder.take(Eigen::Isometry3d::Identity());
  ASSERT_EQ(submap.points_submap.size(), 1U);
  EXPECT_EQ(submap.classes[0], SemanticClass::building);
}

TEST(SubmapBuilder, StandingStillIsOneScan) {
  SubmapBuilder builder({.min_scans = 2});
  LabelledScan scan;
  scan.scan.points_lidar = {{5, 0, 0}};
  scan.motion = {Motion::stationary};
  for (int i = 0; i < 10; ++i) builder.add(scan, Eigen::Isometry3d::Identity());
  EXPECT_TRUE(builder.take(Eigen::Isometry3d::Identity()).points_submap.empty());
}

TEST(SubmapTarget, FindsTheMotionBetweenSubmapsOfOnePlace) {
  const StreetWorld world(3);
  const Submap a = world.submap_at(0.0, 25.0, false, 1);
  const Submap b = world.submap_at(5.0, 30.0, true, 2);
  const Eigen::Isometry3d T_a_b =
      world.T_map_lidar_at(12.0, false).inverse() * world.T_map_lidar_at(18.0, true);
  const Eigen::Isometry3d expected = a.T_submap_key * T_a_b * b.T_submap_key.inverse();
  PoseTangent off;
  off << 0.4, -0.3, 0.2, 0.005, -0.005, 0.02;
  const OdometryResult found = SubmapTarget(a).register_submap(b, boxplus(expected, off));
  EXPECT_EQ(found.health, OdometryHealth::good);
  EXPECT_LT(boxminus(found.T_map_lidar, expected).head<3>().norm(), 0.03);
  EXPECT_LT(boxminus(found.T_map_lidar, expected).tail<3>().norm(), 0.003);
  EXPECT_GT(found.upright_fit, 0.6);
}

/// Lanes of equal houses: the other lane, farther away than odometry can have drifted, was tried.
TEST(SubmapMatch, WhereNothingInTheWindowMeetsNothingIsFound) {
  const StreetWorld world(3);
  const PlacedSubmap a(world.submap_at(0.0, 25.0, false, 1));
  const PlacedSubmap b(world.submap_at(0.0, 25.0, false, 2));
  const AlignmentWindow window{.reach_m = 2.0};
  const auto match_from = [&](double away_m) {
    return match_submaps(a, b, Eigen::Isometry3d(Eigen::Translation3d(away_m, 0.0, 0.0)), window,
                         {});
  };
  const auto here = match_from(0.0);
  ASSERT_TRUE(here);
  EXPECT_EQ(here->refusal, "");
  EXPECT_FALSE(match_from(150.0));
}

/// Each place of a drive in a map is looked for from the one before: in rotations, rounding grew by
/// three with every match.
TEST(EarlierMap, PosesThatFollowFromOneAnotherStayRigid) {
  const StreetWorld world(5);
  const EarlierMap map(world.earlier_map(-30.0, 60.0, 7));
  const Submap submap = world.submap_at(0.0, 25.0, false, 2);
  Eigen::Isometry3d T_map_key =
      world.T_map_lidar_at(0.0, false).inverse() * world.T_map_lidar_at(12.0, false);
  T_map_key.linear() *= 1.0 + 1e-7;
  for (int k = 0; k < 4; ++k) {
    const auto found = map.match(submap, T_map_key, 10.0);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->match.refusal, "");
    T_map_key = found->T_map_key;
    const Eigen::Matrix3d R = T_map_key.linear();
    EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace stillmap
