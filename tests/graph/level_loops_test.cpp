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

/// Closures of a drive by odometry without drift, and how far off the worst of them is.
struct Closures {
  std::size_t count = 0;
  double worst_m = 0.0;
};

Closures closures_of(const BoxWorld& world, const std::vector<Eigen::Isometry3d>& poses) {
  LoopCloser closer{LoopClosingConfig{}};
  for (std::size_t k = 0; k < poses.size(); ++k)
    closer.add(world.scan_at(poses[k], k + 1), poses[k], true);
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

}  // namespace
}  // namespace stillmap
