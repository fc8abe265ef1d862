#include "clients/commands/evaluate/traversability_truth.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "config/loaders/robot_profile.hpp"
#include "core/map/static_map.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap::cli {
namespace {

/// A perfect mapper: true labels at true poses, nothing that moves or is parked.
StaticMap map_of(const simulation::Simulation& simulation) {
  StaticMap map{StaticMapConfig{}};
  const Eigen::Isometry3d T_map_city = simulation.T_map_lidar_at(0.0).inverse();
  for (int i = 0; i < simulation.config().scans; ++i) {
    const simulation::SimulatedScan simulated = simulation.scan(i);
    LabelledScan scan;
    scan.scan = simulated.scan;
    for (const std::uint32_t raw : simulated.raw_labels) {
      const auto id = static_cast<std::uint16_t>(raw);
      scan.labels.classes.push_back(class_from_semantic_kitti(id));
      scan.labels.confidence.push_back(1.0F);
      const bool may_move = is_movable(scan.labels.classes.back());
      scan.motion.push_back(may_move ? Motion::highly_dynamic : Motion::stationary);
    }
    map.insert(scan, T_map_city * simulated.T_map_lidar);
  }
  return map;
}

class YardArea : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    simulation::SimulationConfig config;
    config.plan = simulation::test_yard();
    config.scans = 40;
    config.firings = 900;
    const simulation::Simulation simulation(config);
    map_.emplace(map_of(simulation));
    truth_ = std::make_unique<simulation::CityTruth>(config);
    T_city_map_ = simulation.T_map_lidar_at(0.0);
  }
  static void TearDownTestSuite() {
    map_.reset();
    truth_.reset();
  }
  static evaluation::TraversabilityScore score(const std::string& robot) {
    TraversabilityMap area({load_robot_profile(robot)});
    const auto map = map_->view();
    (void)area.update(*map);
    const auto view = area.view(robot);
    return evaluation::score_traversability(
        *view, simulated_traversability(*truth_, view->profile, view->cell_m, T_city_map_));
  }
  static std::optional<StaticMap> map_;
  static std::unique_ptr<simulation::CityTruth> truth_;
  static Eigen::Isometry3d T_city_map_;
};
std::optional<StaticMap> YardArea::map_;
std::unique_ptr<simulation::CityTruth> YardArea::truth_;
Eigen::Isometry3d YardArea::T_city_map_ = Eigen::Isometry3d::Identity();

TEST_F(YardArea, WhatIsFreeForACarIsRoadWithFewExceptions) {
  const evaluation::TraversabilityScore score = YardArea::score("car");
  EXPECT_GT(*score.precision(true), 0.97);
  EXPECT_GT(*score.recall(), 0.85);
  // A car must not be sent into a house, over a kerb or onto grass.
  const auto cells = [&](evaluation::FalseFree cause) {
    return static_cast<double>(score.false_free.at(static_cast<std::size_t>(cause)));
  };
  const auto free = static_cast<double>(score.free_and_truly_free);
  EXPECT_LT(cells(evaluation::FalseFree::obstacle) / free, 0.01);
  EXPECT_LT(cells(evaluation::FalseFree::ground_class) / free, 0.005);
  EXPECT_LT(cells(evaluation::FalseFree::inferred) / free, 0.02);
}

TEST_F(YardArea, ATrackedRobotHasMoreRoomThanACar) {
  const evaluation::TraversabilityScore car = YardArea::score("car");
  const evaluation::TraversabilityScore tracked = YardArea::score("tracked");
  EXPECT_GT(tracked.free_and_truly_free, car.free_and_truly_free);
  EXPECT_GT(*tracked.precision(true), 0.9);
}

}  // namespace
}  // namespace stillmap::cli
