#include <gtest/gtest.h>

#include <algorithm>

#include "core/odometry/motion_classification.hpp"
#include "tests/odometry/box_world.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::BoxWorld;
using test::car_size_m;

/// A wall across the view at 30 m.
BoxWorld walled() {
  BoxWorld world;
  world.stand(30.5, 0.0, {1.0, 60.0, 8.0}, SemanticClass::building);
  return world;
}

/// A car whose rear is `rear_x` ahead of the origin.
BoxWorld with_car(double rear_x) {
  BoxWorld world = walled();
  world.stand(rear_x + 0.5 * car_size_m.x(), 0.0, car_size_m, SemanticClass::car);
  return world;
}

RangeImageView view(const BoxWorld& world,
                    const Eigen::Isometry3d& T_map_lidar = Eigen::Isometry3d::Identity()) {
  const test::BoxScan seen = world.scan(test::test_lidar(), T_map_lidar, 0.0);
  return {seen.scan, seen.scan.labels, test::test_lidar(), T_map_lidar};
}

MotionConfig every_view() {
  MotionConfig config;
  config.range_image_history_size = 1;
  config.range_image_history_interval = 1;
  return config;
}

/// What one view of `before` says of a point that is seen in `now`.
PastObservation observation(const BoxWorld& before, const BoxWorld& now,
                            const Eigen::Vector3f& p_map) {
  RangeImageHistory history(every_view());
  history.add(view(before));
  return history.observation(0, p_map, view(now));
}

const Eigen::Vector3f rear_at_10m(10.0F, 0.0F, -0.8F);

TEST(RangeImageHistory, PlaceThatARayPassedWasFree) {
  EXPECT_EQ(observation(walled(), with_car(10.0), rear_at_10m), PastObservation::free);
}

TEST(RangeImageHistory, PlaceOfTheSameCarIsTheSame) {
  EXPECT_EQ(observation(with_car(10.0), with_car(10.0), rear_at_10m), PastObservation::same);
}

TEST(RangeImageHistory, TellsHowFarTheLidarHasComeSinceTheOldestView) {
  MotionConfig two_views = every_view();
  two_views.range_image_history_size = 2;
  RangeImageHistory history(two_views);
  history.add(view(walled(), test::level_pose(1.0, 0.0, 0.0)));
  EXPECT_EQ(history.distance_from_oldest_m({3.0, 0.0, 0.0}), 0.0) << "too few views";
  history.add(view(walled(), test::level_pose(2.0, 0.0, 0.0)));
  EXPECT_NEAR(history.distance_from_oldest_m({3.0, 0.0, 0.0}), 2.0, 1e-5);
}

TEST(RangeImageHistory, PlaceHiddenByAWallIsUnknown) {
  BoxWorld hidden = walled();
  hidden.stand(6.0, 0.0, {0.5, 10.0, 4.0}, SemanticClass::building);
  EXPECT_EQ(observation(hidden, with_car(10.0), rear_at_10m), PastObservation::unknown);
}

TEST(RangeImageHistory, PlaceBehindACarThatIsStillThereIsUnknown) {
  BoxWorld both = with_car(10.0);
  both.stand(7.0, 0.0, {1.0, 3.0, 1.6}, SemanticClass::car);
  EXPECT_EQ(observation(both, both, rear_at_10m), PastObservation::unknown);
}

TEST(RangeImageHistory, CarThatDroveOnAheadIsGoneFromBeforeItsRear) {
  EXPECT_EQ(observation(with_car(8.5), with_car(10.0), rear_at_10m),
            PastObservation::removed_in_front);
}

TEST(RangeImageHistory, AnotherCarFarBeforeItSaysNothing) {
  EXPECT_EQ(observation(with_car(5.0), with_car(10.0), rear_at_10m), PastObservation::unknown)
      << "5 m in a scan is no motion of one car";
}

TEST(RangeImageHistory, DirectionWithoutReturnIsUnknown) {
  const BoxWorld open;
  EXPECT_EQ(observation(open, with_car(10.0), {10.0F, 0.0F, 0.8F}), PastObservation::unknown);
}

TEST(RangeImageHistory, PlaceOutsideTheFieldOfViewIsUnknown) {
  EXPECT_EQ(observation(walled(), walled(), {2.0F, 0.0F, 3.0F}), PastObservation::unknown);
  EXPECT_EQ(observation(walled(), walled(), {0.5F, 0.0F, -1.6F}), PastObservation::unknown);
  EXPECT_EQ(observation(walled(), walled(), {0.0F, 0.0F, 0.0F}), PastObservation::unknown);
}

TEST(RangeImageHistory, LookFromAnotherPlaceAgrees) {
  const Eigen::Isometry3d T_before = test::level_pose(-4.0, 1.5, 0.6);
  RangeImageHistory history(every_view());
  history.add(view(walled(), T_before));
  EXPECT_EQ(history.observation(0, rear_at_10m, view(with_car(10.0))), PastObservation::free);
  history.add(view(with_car(10.0), T_before));
  EXPECT_EQ(history.observation(0, rear_at_10m, view(with_car(10.0))), PastObservation::same);
}

TEST(RangeImageHistory, MarginKeepsANearbySurfaceFromBeingFree) {
  EXPECT_EQ(observation(with_car(10.4), with_car(10.0), rear_at_10m), PastObservation::unknown);
  EXPECT_EQ(observation(with_car(11.5), with_car(10.0), rear_at_10m), PastObservation::free);
}

TEST(RangeImageHistory, KeepsOneViewEachInterval) {
  MotionConfig config;
  config.range_image_history_size = 2;
  config.range_image_history_interval = 3;
  RangeImageHistory history(config);
  // The car comes a metre nearer in each view: 20 m in the first, 13 m in the last.
  for (int k = 0; k < 8; ++k) {
    EXPECT_EQ(history.size(), static_cast<std::size_t>(std::min(k / 3, 2)));
    history.add(view(with_car(20.0 - k)));
  }
  const RangeImageView now = view(walled());
  // Three views ago it stood at 15 m, six views ago at 18 m.
  EXPECT_EQ(history.observation(0, {15.0F, 0.0F, -0.8F}, now), PastObservation::same);
  EXPECT_EQ(history.observation(1, {18.0F, 0.0F, -0.8F}, now), PastObservation::same);
}

TEST(RangeImageView, SeesThePointsOfItsScan) {
  const BoxWorld world = with_car(10.0);
  const Eigen::Isometry3d T_map_lidar = test::level_pose(2.0, 1.0, -2.9);
  const test::BoxScan seen = world.scan(test::test_lidar(), T_map_lidar, 0.0);
  const RangeImageView from_here(seen.scan, seen.scan.labels, test::test_lidar(), T_map_lidar);
  for (std::size_t i = 0; i < seen.scan.size(); ++i) {
    const auto look = from_here.observe(T_map_lidar.cast<float>() * seen.scan.points_lidar[i]);
    ASSERT_TRUE(look) << i;
    EXPECT_NEAR(look->range_m, look->point_range_m, 0.02F);
    EXPECT_EQ(look->movable, seen.scan.labels[i] == SemanticClass::car);
    EXPECT_FALSE(from_here.sees_past(*look, look->range_m));
    EXPECT_TRUE(from_here.sees_past(*look, 0.1F));
  }
}

}  // namespace
}  // namespace stillmap
