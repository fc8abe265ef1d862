#include "core/localization/localizer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>
#include <vector>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/prepare.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/localization/yard_map.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

LocalizationResult localize(const Localizer& localizer, const simulation::SimulatedScan& simulated,
                            bool is_labelled = true) {
  const Scan scan = drop_unusable_points(simulated.scan, PrepareConfig{});
  return localizer.localize(scan, is_labelled ? labels_of(scan) : PointLabels{});
}

void expect_right(const LocalizationResult& result, const Eigen::Isometry3d& T_map_lidar) {
  ASSERT_EQ(result.status, LocalizationStatus::found);
  const Eigen::Isometry3d off = T_map_lidar.inverse() * result.places.front().T_map_lidar;
  EXPECT_LT(off.translation().norm(), 0.3);
  EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle(), 1.0 * rad_per_deg);
}

TEST(Localizer, FindsScansOfAnotherDay) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation simulation(yard(1, 1));
  for (const int k : {30, 95, 170, 225}) {
    SCOPED_TRACE(k);
    const simulation::SimulatedScan scan = simulation.scan(k);
    expect_right(localize(localizer, scan), scan.T_map_lidar);
  }
}

TEST(Localizer, FindsALidarThatLooksTheOtherWayBesideThePath) {
  const Localizer localizer(index_of(first_yard()));
  simulation::SimulationConfig config = yard(1, 1);
  config.T_base_lidar = Eigen::Translation3d(0.0, 2.5, 1.5) *
                        Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ());
  const simulation::Simulation simulation(config);
  for (const int k : {40, 130}) {
    SCOPED_TRACE(k);
    const simulation::SimulatedScan scan = simulation.scan(k);
    expect_right(localize(localizer, scan), scan.T_map_lidar);
  }
}

TEST(Localizer, FindsNoScanOfAnotherCity) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::Simulation simulation(yard(2, 0));
  for (int k = 10; k < 240; k += 30 * slowdown)
    EXPECT_NE(localize(localizer, simulation.scan(k)).status, LocalizationStatus::found) << k;
}

TEST(Localizer, SaysAmbiguousWhereTheMapHoldsAPlaceTwice) {
  const Localizer localizer(index_of(yard_twice()));
  const simulation::Simulation simulation(yard(1, 1));
  EXPECT_EQ(localize(localizer, simulation.scan(95)).status, LocalizationStatus::ambiguous);
}

TEST(Localizer, NeedsNoTrajectory) {
  MappedYard stored = first_yard();
  stored.trajectory.clear();
  const Localizer localizer(index_of(stored));
  const simulation::SimulatedScan scan = simulation::Simulation(yard(1, 1)).scan(95);
  expect_right(localize(localizer, scan), scan.T_map_lidar);
}

TEST(Localizer, FindsNothingInAnEmptyMap) {
  MappedYard empty{std::make_shared<const MapSnapshot>(), {}};
  const simulation::SimulatedScan scan = simulation::Simulation(yard(1, 1)).scan(95);
  EXPECT_EQ(localize(Localizer(index_of(empty)), scan).status, LocalizationStatus::no_evidence);
  // With a path, but without a voxel.
  empty.trajectory = first_yard().trajectory;
  EXPECT_NE(localize(Localizer(index_of(empty)), scan).status, LocalizationStatus::found);
}

TEST(Localizer, FindsNothingInOneTileOfAMap) {
  MappedYard stored = first_yard();
  MapSnapshot view = *stored.view;
  view.tiles = TileTable{stored.view->tiles.front()};
  stored.view = std::make_shared<const MapSnapshot>(std::move(view));
  const simulation::SimulatedScan scan = simulation::Simulation(yard(1, 1)).scan(95);
  EXPECT_NE(localize(Localizer(index_of(stored)), scan).status, LocalizationStatus::found);
}

TEST(Localizer, PassesOverPosesThatAreNone) {
  MappedYard stored = first_yard();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  stored.trajectory[5].T_map_lidar.translation().x() = nan;
  stored.trajectory[6].T_map_lidar.translation().y() = 1e12;
  const Localizer localizer(index_of(stored));
  const simulation::SimulatedScan scan = simulation::Simulation(yard(1, 1)).scan(170);
  expect_right(localize(localizer, scan), scan.T_map_lidar);
}

TEST(Localizer, FindsAScanAtPlacesThatAreKnownAndNowhereElse) {
  const Localizer localizer(index_of(first_yard()));
  const simulation::SimulatedScan scan = simulation::Simulation(yard(1, 1)).scan(95);
  const LocalizationQuery query(drop_unusable_points(scan.scan, PrepareConfig{}), {},
                                Eigen::Matrix3d::Identity());
  std::vector<PlaceHypothesis> places(2);
  places[0].T_map_lidar = Eigen::Translation3d(9.0, 0.0, 0.0) * scan.T_map_lidar;
  places[1].T_map_lidar = Eigen::Translation3d(0.3, -0.4, 0.0) * scan.T_map_lidar;
  expect_right(localizer.localize_at(query, places), scan.T_map_lidar);
  places.pop_back();
  EXPECT_NE(localizer.localize_at(query, places).status, LocalizationStatus::found);
  EXPECT_NE(localizer.localize_at(query, {}).status, LocalizationStatus::found);
}

/// What 16 rings see of a hall of 70 by 40 m from its middle.
Scan hall_scan(double lidar_height_m, double ceiling_height_m) {
  Scan scan;
  const Eigen::Vector3d high(35.0, 20.0, ceiling_height_m - lidar_height_m);
  const Eigen::Vector3d low(-35.0, -20.0, -lidar_height_m);
  for (int ring = 0; ring < 16; ++ring) {
    const double elevation = (15.0 - 2.0 * ring) * rad_per_deg;
    for (int k = 0; k < 900; ++k) {
      const double azimuth = 0.4 * k * rad_per_deg;
      const Eigen::Vector3d ray(std::cos(elevation) * std::cos(azimuth),
                                std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
      double range_m = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; ++axis)
        range_m = std::min(range_m, (ray[axis] > 0.0 ? high[axis] : low[axis]) / ray[axis]);
      scan.points_lidar.push_back((range_m * ray).cast<float>());
      scan.ring.push_back(static_cast<std::uint16_t>(ring));
    }
  }
  return scan;
}

TEST(LocalizationQuery, StandsOnTheFloorUnderneathACeilingThatItSeesMoreOf) {
  for (const auto& [lidar_height_m, ceiling_height_m] :
       {std::pair(0.5, 2.7), std::pair(0.5, 3.5), std::pair(1.2, 2.7), std::pair(1.7, 8.0)}) {
    const LocalizationQuery query(hall_scan(lidar_height_m, ceiling_height_m), {},
                                  Eigen::Matrix3d::Identity());
    EXPECT_TRUE(query.has_ground) << lidar_height_m << " m under " << ceiling_height_m;
    EXPECT_NEAR(query.T_foot_upright.translation().z(), lidar_height_m, 0.05);
  }
}

TEST(Localizer, AScanWithoutPointsIsNoEvidence) {
  const Localizer localizer(index_of(first_yard()));
  EXPECT_EQ(localizer.localize({}, {}).status, LocalizationStatus::no_evidence);
  Scan level;
  for (int k = 0; k < 500; ++k)
    level.points_lidar.emplace_back(0.1F * static_cast<float>(k % 50),
                                    0.5F * static_cast<float>(k / 50), -1.7F);
  EXPECT_EQ(localizer.localize(level, {}).status, LocalizationStatus::no_evidence);
}

}  // namespace
}  // namespace stillmap::test
