#include <gtest/gtest.h>

#include <memory>
#include <optional>

#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap {
namespace {

using simulation::Simulation;
using simulation::SimulationConfig;

/// A street where nearly all that is near keeps the lidar's pace or comes towards it.
SimulationConfig crowded_street() {
  SimulationConfig config;
  config.plan = simulation::crowded_avenue();
  config.seed = 101;
  config.sensor = vlp_16();
  config.scans = 8;
  return config;
}

/// The motion to scan k from the one before, in truth.
Eigen::Isometry3d true_motion(const Simulation& simulation, int k) {
  const double period_s = simulation.config().sensor.period_s;
  return simulation.T_map_lidar_at((k - 1) * period_s).inverse() *
         simulation.T_map_lidar_at(k * period_s);
}

class WeightingOfCrowdedDrives : public ::testing::TestWithParam<Weighting> {};

TEST_P(WeightingOfCrowdedDrives, FindTheFirstMotionOfASparseLidar) {
  const Simulation simulation(crowded_street());
  MapperConfig config;
  config.sensor = simulation.config().sensor;
  config.odometry.weighting = GetParam();
  Mapper mapper(config, std::make_unique<PassthroughSegmenter>());
  Eigen::Isometry3d T_map_last = Eigen::Isometry3d::Identity();
  for (int k = 0; k < simulation.config().scans; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    const Eigen::Isometry3d T_map_lidar = mapped->odometry.T_map_lidar;
    if (k > 0) {
      const Eigen::Isometry3d off =
          true_motion(simulation, k).inverse() * (T_map_last.inverse() * T_map_lidar);
      EXPECT_LT(off.translation().norm(), 0.2) << "scan " << k;
    }
    T_map_last = T_map_lidar;
  }
}

/// Traffic hides for seconds nearly all that 16 rings know: a lidar that is called lost there adds
/// nothing to its local map, knows less with every scan, and is lost for good.
TEST(CrowdedDrives, FollowASparseLidarThroughDenseTraffic) {
  SimulationConfig config = crowded_street();
  config.seed = 4;
  config.scans = 320;
  constexpr int first = 225;
  const Simulation simulation(config);
  MapperConfig mapping;
  mapping.sensor = config.sensor;
  Mapper mapper(mapping, std::make_unique<PassthroughSegmenter>());
  std::optional<Eigen::Isometry3d> T_map_last;
  int lost = 0;
  for (int k = first; k < config.scans; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    const bool is_lost = mapped->odometry.health == OdometryHealth::lost;
    const Eigen::Isometry3d T_map_lidar = mapped->odometry.T_map_lidar;
    if (!is_lost && T_map_last) {
      const Eigen::Isometry3d off =
          true_motion(simulation, k).inverse() * (T_map_last->inverse() * T_map_lidar);
      EXPECT_LT(off.translation().norm(), 0.7) << "scan " << k;
    }
    lost += is_lost ? 1 : 0;
    T_map_last = is_lost ? std::nullopt : std::optional(T_map_lidar);
  }
  EXPECT_LE(lost, 3);
}

/// The rings' lines on walls come nearer with the lidar: they took its pitch along by a degree on
/// such a stretch.
TEST(CrowdedDrives, KeepASparseLidarLevel) {
  SimulationConfig config = crowded_street();
  config.seed = 4;
  constexpr int first = 1780;
  config.scans = first + 40;
  const Simulation simulation(config);
  MapperConfig mapping;
  mapping.sensor = config.sensor;
  Mapper mapper(mapping, std::make_unique<PassthroughSegmenter>());
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  for (int k = first; k < config.scans; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    T_map_lidar = mapped->odometry.T_map_lidar;
  }
  const double period_s = config.sensor.period_s;
  const Eigen::Isometry3d truth = simulation.T_map_lidar_at(first * period_s).inverse() *
                                  simulation.T_map_lidar_at((config.scans - 1) * period_s);
  const Eigen::Isometry3d off = truth.inverse() * T_map_lidar;
  EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle() * 180.0 / M_PI, 0.5);
  EXPECT_LT(off.translation().norm(), 0.15);
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutLabels, WeightingOfCrowdedDrives,
                         ::testing::Values(Weighting::semantic, Weighting::geometric,
                                           Weighting::none));

}  // namespace
}  // namespace stillmap
