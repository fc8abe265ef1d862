#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/graph/loop_closer.hpp"
#include "tests/graph/level_worlds.hpp"

namespace stillmap {
namespace {

using levels::BoxWorld;
using levels::bridge_world;
using levels::car_park;
using levels::drive;
using levels::drive_away;
using levels::drive_round;
using levels::viaduct_world;

/// Closures of a drive, and how far off the worst of them is.
struct Closures {
  std::size_t count = 0;
  double worst_m = 0.0;
};

Closures closures_of(const BoxWorld& world, const std::vector<Eigen::Isometry3d>& poses,
                     const std::vector<Eigen::Isometry3d>& T_odom_lidar) {
  LoopCloser closer{LoopClosingConfig{}};
  for (std::size_t k = 0; k < poses.size(); ++k)
    closer.add(world.scan_at(poses[k], k + 1), T_odom_lidar[k], true);
  closer.finish();
  Closures found;
  for (const LoopClosure& closure : closer.closures()) {
    const Eigen::Isometry3d truth = poses[closure.from_scan].inverse() * poses[closure.to_scan];
    ++found.count;
    found.worst_m =
        std::max(found.worst_m, (truth.inverse() * closure.T_from_to).translation().norm());
  }
  return found;
}

/// By odometry without drift.
Closures closures_of(const BoxWorld& world, const std::vector<Eigen::Isometry3d>& poses) {
  return closures_of(world, poses, poses);
}

TEST(LoopsOnLevels, ABridgeIsNotTheStreetThatLeadsUnderIt) {
  constexpr double deck_m = 5.5;
  constexpr double low_m = deck_m - 0.07 * 46.0;
  const BoxWorld world = bridge_world(2, deck_m);
  std::vector<Eigen::Isometry3d> poses;
  drive(poses, {-60, 0, 0}, {60, 0, 0});
  drive_away(poses, 700);
  drive(poses, {0, -60, low_m}, {0, -14, deck_m});
  drive(poses, {0, -13, deck_m}, {0, 14, deck_m});
  drive(poses, {0, 15, deck_m}, {0, 60, low_m});
  EXPECT_LT(closures_of(world, poses).worst_m, 0.3);
}

/// Of a drive under a viaduct, away, and along it.
Closures closures_of_viaduct(double deck_m, double away_m, double highest_beam_deg,
                             double span_deg) {
  BoxWorld world = viaduct_world(2, deck_m);
  world.highest_beam_deg = highest_beam_deg;
  world.span_deg = span_deg;
  std::vector<Eigen::Isometry3d> poses;
  drive(poses, {-33, 0, 0}, {33, 0, 0});
  drive_away(poses, away_m);
  drive(poses, {-33, 0, deck_m}, {33, 0, deck_m});
  return closures_of(world, poses);
}

TEST(LoopsOnLevels, AViaductIsNotTheStreetUnderneathWhateverTheLidarSeesOfIt) {
  // From 4 degrees on it begins to see walls beside itself; from 8.5 on the deck, now and then.
  for (const double highest_beam_deg : {2.0, 4.0, 7.0, 8.5, 9.5, 15.0})
    EXPECT_LT(closures_of_viaduct(5.5, 700, highest_beam_deg, 20.0).worst_m, 0.3)
        << highest_beam_deg;
  EXPECT_LT(closures_of_viaduct(10.5, 2200, 15.0, 30.0).worst_m, 0.3);
}

TEST(LoopsOnLevels, StoreysOfACarParkAreNotOneAnother) {
  const BoxWorld world = car_park(4, 2);
  std::vector<Eigen::Isometry3d> poses;
  drive_round(poses, 0.0);
  drive_away(poses, 500);
  drive_round(poses, 3.0);
  EXPECT_LT(closures_of(world, poses).worst_m, 0.3);
}

TEST(LoopsOnLevels, StoreysThatAreKnownAreFoundAgain) {
  const BoxWorld world = car_park(4, 3);
  std::vector<Eigen::Isometry3d> poses;
  for (int storey = 0; storey < 3; ++storey) drive_round(poses, 3.0 * storey);
  drive_away(poses, 500);
  drive_round(poses, 3.0);
  const Closures found = closures_of(world, poses);
  EXPECT_LT(found.worst_m, 0.3);
  EXPECT_GE(found.count, 2U);
}

/// So long that closures agree on all the plan that another level asks for.
constexpr double long_m = 120.0;

TEST(LoopsOnLevels, StoreysOfALongCarParkAreNotOneAnother) {
  const BoxWorld world = car_park(4, 2, long_m);
  for (const bool is_first_below : {true, false}) {
    std::vector<Eigen::Isometry3d> poses;
    const double first_m = is_first_below ? 0.0 : 3.0;
    drive(poses, {6, 7, first_m}, {long_m - 6.0, 7, first_m});
    drive_away(poses, 500);
    drive(poses, {6, 7, 3.0 - first_m}, {long_m - 6.0, 7, 3.0 - first_m});
    EXPECT_LT(closures_of(world, poses).worst_m, 0.3) << is_first_below;
  }
}

TEST(LoopsOnLevels, DriftUnderACeilingIsTakenOutUpToHalfAStorey) {
  const BoxWorld world = car_park(4, 2, long_m);
  std::vector<Eigen::Isometry3d> poses;
  drive(poses, {6, 7, 0}, {long_m - 6.0, 7, 0});
  const std::size_t back = poses.size();
  drive_away(poses, 500);
  drive(poses, {6, 7, 0}, {long_m - 6.0, 7, 0});
  for (const double off_m : {-1.2, 1.2}) {
    std::vector<Eigen::Isometry3d> T_odom_lidar = poses;
    for (std::size_t k = back; k < poses.size(); ++k) T_odom_lidar[k].translation().z() += off_m;
    const Closures found = closures_of(world, poses, T_odom_lidar);
    EXPECT_GE(found.count, 2U) << off_m;
    EXPECT_LT(found.worst_m, 0.3) << off_m;
  }
}

}  // namespace
}  // namespace stillmap
