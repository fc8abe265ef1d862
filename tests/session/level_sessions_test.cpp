#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/session/map_alignment.hpp"
#include "tests/graph/level_worlds.hpp"
#include "tests/session/street_maps.hpp"

namespace stillmap {
namespace {

using Poses = std::vector<Eigen::Isometry3d>;

SavedMap map_of(const levels::BoxWorld& world, const Poses& poses) {
  return map_of_scans(
      poses, [&](std::size_t k) { return world.scan_at(poses[k], k + 1); }, 1);
}

/// By odometry without drift.
MapAlignment alignment_of(const levels::BoxWorld& world, const Poses& poses, const SavedMap& map) {
  const auto scan_at = [&](std::size_t k) { return world.scan_at(poses[k], 5000 + k); };
  LoopCloser drive{LoopClosingConfig{}};
  for (std::size_t k = 0; k < poses.size(); ++k) drive.add(scan_at(k), poses[k], true);
  drive.finish();
  return MapAligner(index_of(map)).align(drive, scan_at, Eigen::Matrix3d::Identity());
}

double worst_m(const MapAlignment& alignment, const Poses& poses) {
  double worst = 0.0;
  for (std::size_t k = 0; k < alignment.T_map_lidar.size(); ++k)
    worst = std::max(worst, (poses[k].inverse() * alignment.T_map_lidar[k]).translation().norm());
  return worst;
}

/// Storeys are alike, and odometry may have drifted by one on the way.
TEST(SessionsOnLevels, AStoreyThatTheMapDoesNotHoldIsNotTheOneBelow) {
  const levels::BoxWorld world = levels::car_park(4, 2);
  Poses first, second;
  levels::drive_round(first, 0.0);
  levels::drive_round(second, 0.0);
  levels::drive_away(second, 500);
  levels::drive_round(second, 3.0);
  const MapAlignment alignment = alignment_of(world, second, map_of(world, first));
  ASSERT_TRUE(alignment.is_recognized()) << alignment.in_words();
  EXPECT_GE(alignment.closures.size(), 4U);
  for (const MapClosure& closure : alignment.closures)
    EXPECT_LT((second[closure.scan].inverse() * closure.T_map_lidar).translation().norm(), 0.3)
        << closure.scan;
  EXPECT_LT(worst_m(alignment, second), 0.3);
}

TEST(SessionsOnLevels, OfAMapOfSeveralStoreysEachIsFound) {
  const levels::BoxWorld world = levels::car_park(4, 2);
  Poses first;
  levels::drive_round(first, 0.0);
  levels::drive_round(first, 3.0);
  const SavedMap map = map_of(world, first);
  for (const double storey_m : {0.0, 3.0}) {
    Poses second;
    levels::drive_round(second, storey_m);
    const MapAlignment alignment = alignment_of(world, second, map);
    ASSERT_TRUE(alignment.is_recognized()) << storey_m << ": " << alignment.in_words();
    EXPECT_GE(alignment.closures.size(), 4U);
    EXPECT_LT(worst_m(alignment, second), 0.3);
  }
}

/// On so much of the plan that closures may lead to another level.
TEST(SessionsOnLevels, NorIsTheOneAboveALongOne) {
  constexpr double long_m = 120.0;
  const levels::BoxWorld world = levels::car_park(4, 2, long_m);
  Poses first, second;
  for (Poses* const poses : {&first, &second})
    levels::drive(*poses, {6, 7, 0}, {long_m - 6.0, 7, 0});
  levels::drive_away(second, 500);
  levels::drive(second, {6, 7, 3}, {long_m - 6.0, 7, 3});
  const MapAlignment alignment = alignment_of(world, second, map_of(world, first));
  ASSERT_TRUE(alignment.is_recognized()) << alignment.in_words();
  EXPECT_GE(alignment.closures.size(), 3U);
  EXPECT_LT(worst_m(alignment, second), 0.5);
}

/// The crossing is all that a drive over the bridge has in common with the street.
TEST(SessionsOnLevels, ABridgeIsNotPutOnTheStreetOfTheMap) {
  constexpr double deck_m = 5.5;
  constexpr double low_m = deck_m - 0.07 * 36.0;
  const levels::BoxWorld world = levels::bridge_world(3, deck_m);
  Poses street, bridge;
  levels::drive(street, {-50, 0, 0}, {50, 0, 0});
  levels::drive(bridge, {0, -50, low_m}, {0, -14, deck_m});
  levels::drive(bridge, {0, -13, deck_m}, {0, 14, deck_m});
  levels::drive(bridge, {0, 15, deck_m}, {0, 50, low_m});
  const SavedMap map = map_of(world, street);
  const MapAlignment over = alignment_of(world, bridge, map);
  EXPECT_FALSE(over.is_recognized()) << over.in_words();
  // Who drives under the bridge sees it.
  Poses again;
  levels::drive(again, {-25, 0, 0}, {25, 0, 0});
  const MapAlignment under = alignment_of(world, again, map);
  ASSERT_TRUE(under.is_recognized()) << under.in_words();
  EXPECT_LT(worst_m(under, again), 0.3);
}

}  // namespace
}  // namespace stillmap
