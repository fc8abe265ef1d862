#include "core/simulation/city_truth.hpp"

#include <gtest/gtest.h>

#include <map>

#include "core/simulation/ground.hpp"

namespace stillmap::simulation {
namespace {

SimulationConfig yard() {
  SimulationConfig config;
  config.plan = test_yard();
  config.scans = 1;
  return config;
}

class CityTruthTest : public ::testing::Test {
 protected:
  [[nodiscard]] TrueGround at(const Eigen::Vector2d& spot_city) const {
    return truth_.at(spot_city, 0.2, 0.1, 2.0);
  }
  SimulationConfig config_ = yard();
  GroundShape ground_{config_.plan, config_.seed};
  CityTruth truth_{config_};
};

TEST_F(CityTruthTest, GroundIsThatOfThePlanWhereItIsBent) {
  for (double u = -30.0; u <= 60.0; u += 3.7) {
    for (double v = -30.0; v <= 60.0; v += 4.1) {
      const Eigen::Vector2d spot_plan(u, v);
      const Eigen::Vector3d on_ground = ground_.on_ground(spot_plan);
      EXPECT_NEAR(at(on_ground.head<2>()).height_m, on_ground.z(), 1e-3);
    }
  }
}

TEST_F(CityTruthTest, TheWayOfTheLidarIsRoadWithNothingOnIt) {
  SimulationConfig config = config_;
  config.scans = 100;
  const Simulation simulation(config);
  for (double time_s = 0.0; time_s < 10.0; time_s += 0.5) {
    const TrueGround ground = at(simulation.T_map_lidar_at(time_s).translation().head<2>());
    EXPECT_EQ(ground.label, SemanticClass::road);
    EXPECT_EQ(ground.standing, Standing::nothing);
    EXPECT_LT(ground.step_m, 0.05);
  }
}

TEST_F(CityTruthTest, FindsKerbsHousesAndParkedVehicles) {
  std::map<Standing, int> standing;
  int kerbs = 0;
  for (double x = -40.0; x <= 80.0; x += 0.5) {
    for (double y = -40.0; y <= 80.0; y += 0.5) {
      const TrueGround ground = at({x, y});
      ++standing[ground.standing];
      const bool is_pavement = ground.label == SemanticClass::sidewalk;
      if (is_pavement && ground.is_edge && ground.step_m > 0.7 * config_.plan.kerb_m) ++kerbs;
    }
  }
  EXPECT_GT(standing[Standing::fixed], 100);
  EXPECT_GT(standing[Standing::parked], 20);
  EXPECT_GT(standing[Standing::nothing], standing[Standing::parked]);
  EXPECT_GT(kerbs, 20);
}

}  // namespace
}  // namespace stillmap::simulation
