#include <gtest/gtest.h>

#include <memory>

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

class CrowdedDrives : public ::testing::TestWithParam<Weighting> {};

TEST_P(CrowdedDrives, FindTheFirstMotionOfASparseLidar) {
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
      const double now_s = k * simulation.config().sensor.period_s;
      const Eigen::Isometry3d T_last_now =
          simulation.T_map_lidar_at(now_s - simulation.config().sensor.period_s).inverse() *
          simulation.T_map_lidar_at(now_s);
      const Eigen::Isometry3d off = T_last_now.inverse() * (T_map_last.inverse() * T_map_lidar);
      EXPECT_LT(off.translation().norm(), 0.2) << "scan " << k;
    }
    T_map_last = T_map_lidar;
  }
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutLabels, CrowdedDrives,
                         ::testing::Values(Weighting::semantic, Weighting::geometric,
                                           Weighting::none));

}  // namespace
}  // namespace stillmap
