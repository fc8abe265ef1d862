#include "core/localization/global_localization.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <numbers>

#include "core/lidar/prepare.hpp"
#include "core/lidar/rings.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/localization/yard_map.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

using Outcome = GlobalLocalization::Outcome;

/// Follows scans `first`, `first` + `step`, ... of a drive, and looks for each, until a place is
/// confirmed or `count` were tried.
Outcome search(GlobalLocalization& search, const simulation::Simulation& simulation,
               const Localizer& localizer, int first, int step, int count) {
  Outcome outcome = Outcome::nothing_new;
  for (int k = first; k < first + count * step; k += step) {
    const Scan scan = drop_unusable_points(simulation.scan(k).scan, PrepareConfig{});
    search.follow(scan, labels_of(scan));
    outcome = search.search(localizer, Eigen::Matrix3d::Identity());
    if (outcome == Outcome::confirmed) break;
  }
  return outcome;
}

GlobalLocalization global_localization() { return {OdometryConfig{}, yard(1, 1).sensor}; }

void expect_at(const Eigen::Isometry3d& T, const Eigen::Isometry3d& T_true) {
  const Eigen::Isometry3d off = T_true.inverse() * T;
  EXPECT_LT(off.translation().norm(), 0.3);
  EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle(), 1.0 * std::numbers::pi / 180.0);
}

TEST(GlobalLocalization, ScansThatFollowConfirmWhatWasFound) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation simulation(yard(1, 1));
  GlobalLocalization lost = global_localization();
  EXPECT_EQ(search(lost, simulation, localizer, 95, 1, 3), Outcome::confirming);
  EXPECT_EQ(search(lost, simulation, localizer, 98, 1, 1), Outcome::confirmed);
  EXPECT_EQ(lost.scans_tried(), 4);
  const GlobalLocalization::Place place = lost.take_place();
  const simulation::SimulatedScan last = simulation.scan(98);
  expect_at(place.T_map_odom * place.odometry.predict(last.stamp_ns), last.T_map_lidar);
}

TEST(GlobalLocalization, ConfirmsNothingInAnotherCity) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation elsewhere(yard(2, 0));
  GlobalLocalization lost = global_localization();
  // Eight minutes of ThreadSanitizer else, on code that the other tests run under it, too.
  constexpr int scans = 20 / slowdown;
  EXPECT_NE(search(lost, elsewhere, localizer, 10, 1, scans), Outcome::confirmed);
  EXPECT_EQ(lost.scans_tried(), scans);
}

TEST(GlobalLocalization, LooksForNoScanTwice) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation simulation(yard(1, 1));
  GlobalLocalization lost = global_localization();
  EXPECT_EQ(lost.search(localizer, Eigen::Matrix3d::Identity()), Outcome::nothing_new);
  EXPECT_EQ(search(lost, simulation, localizer, 30, 1, 1), Outcome::found);
  EXPECT_EQ(lost.search(localizer, Eigen::Matrix3d::Identity()), Outcome::nothing_new);
}

TEST(GlobalLocalization, ScansOfAnotherPlaceRefuseWhatWasFound) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation simulation(yard(1, 1));
  GlobalLocalization lost = global_localization();
  EXPECT_EQ(search(lost, simulation, localizer, 95, 1, 1), Outcome::found);
  // The lidar was carried off: odometry cannot follow, and nothing of before is believed.
  EXPECT_NE(search(lost, simulation, localizer, 225, 1, 3), Outcome::confirmed);
  EXPECT_EQ(search(lost, simulation, localizer, 228, 1, 5), Outcome::confirmed);
  const GlobalLocalization::Place place = lost.take_place();
  const Eigen::Isometry3d T =
      place.T_map_odom * place.odometry.predict(simulation.scan(229).stamp_ns);
  EXPECT_LT((T.translation() - simulation.scan(229).T_map_lidar.translation()).norm(), 5.0);
}

TEST(GlobalLocalization, APlaceThatTheMapHoldsTwiceStaysAmbiguous) {
  const Localizer localizer(index_of(yard_twice()));
  const simulation::Simulation simulation(yard(1, 1));
  GlobalLocalization lost = global_localization();
  EXPECT_EQ(search(lost, simulation, localizer, 90, 2, 8), Outcome::ambiguous);
}

TEST(GlobalLocalization, IsFoundInThePartOfTheMapThatItIsLookedForIn) {
  const MappedYard twice = yard_twice();
  const Localizer localizer(index_of(twice));
  const simulation::SimulatedScan simulated = simulation::Simulation(yard(1, 1)).scan(95);
  const Scan scan = drop_unusable_points(simulated.scan, PrepareConfig{});
  const LocalizationQuery query(scan, labels_of(scan), Eigen::Matrix3d::Identity());
  const auto here = [&](double dx_m) {
    return SearchRegion{
        .centre_map = simulated.T_map_lidar.translation().head<2>() + Eigen::Vector2d(dx_m, 0.0),
        .radius_m = 10.0};
  };
  const LocalizationResult first = localizer.localize(query, here(3.0));
  ASSERT_EQ(first.status, LocalizationStatus::found);
  expect_at(first.places.front().T_map_lidar, simulated.T_map_lidar);
  EXPECT_NE(localizer.localize(query, here(50.0)).status, LocalizationStatus::found);
  // The other way round.
  SearchRegion turned = here(0.0);
  const Eigen::Matrix3d R = simulated.T_map_lidar.linear();
  turned.heading_rad = std::atan2(R(1, 0), R(0, 0)) + std::numbers::pi;
  turned.max_turn_rad = 0.5;
  EXPECT_NE(localizer.localize(query, turned).status, LocalizationStatus::found);
  turned.heading_rad -= std::numbers::pi - 0.3;
  EXPECT_EQ(localizer.localize(query, turned).status, LocalizationStatus::found);
}

}  // namespace
}  // namespace stillmap::test
