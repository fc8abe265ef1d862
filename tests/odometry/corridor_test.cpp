#include <gtest/gtest.h>

#include <random>
#include <string>

#include "core/odometry/odometry.hpp"
#include "tests/odometry/box_world.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap::test {
namespace {

/// A corridor of 7 m with smooth walls, pillars along both of them and a far end, 16 rings.
struct Corridor {
  unsigned seed = 0;
  int pillars = 0;
  double speed_m_s = 0.0;

  [[nodiscard]] BoxWorld world() const {
    constexpr double height_m = 4.5;
    constexpr double wall_m = 1.0;
    BoxWorld world;
    world.noise_m = 0.015;
    for (const double side : {-1.0, 1.0})
      world.stand(85.0, side * 4.0, {232.0, wall_m, height_m}, SemanticClass::building);
    for (const double end : {-30.5, 200.5})
      world.stand(end, 0.0, {wall_m, 9.0, height_m}, SemanticClass::building);
    world.boxes.push_back({{85.0, 0.0, height_m + 0.5 * wall_m - BoxWorld::lidar_height_m},
                           {232.0, 9.0, wall_m},
                           SemanticClass::building});
    std::mt19937 random(seed);
    const auto between = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    for (int k = 0; k < pillars; ++k)
      world.stand(between(-25.0, 28.0), (k % 2 == 0 ? 2.6 : -2.6) + between(-0.3, 0.3),
                  {between(0.6, 1.6), between(0.4, 1.0), 2.8}, SemanticClass::building);
    return world;
  }
};

SensorModel lidar() {
  SensorModel sensor = vlp_16();
  sensor.columns = 900;
  return sensor;
}

class Corridors : public testing::TestWithParam<Corridor> {};

/// Rings lie on smooth walls as they did before, wherever the lidar has gone: by them it stood
/// still, `good`, though a third of its points were on pillars that passed by.
TEST_P(Corridors, ALidarThatSetsOffBetweenPillarsIsFollowed) {
  const Corridor corridor = GetParam();
  const BoxWorld world = corridor.world();
  OdometryConfig config;
  config.weighting = Weighting::geometric;
  Odometry odometry(config, lidar());
  double x_m = 0.0;
  for (int k = 0; k < 40; ++k) {
    x_m += 0.1 * corridor.speed_m_s * std::min(1.0, 0.1 * k);
    Scan scan =
        world.scan(lidar(), Eigen::Isometry3d(Eigen::Translation3d(x_m, 0.2, 0.0)), 0.1 * k).scan;
    scan.labels.clear();
    const OdometryResult result = odometry.register_scan(scan, {}, {}, std::nullopt).result;
    ASSERT_NE(result.health, OdometryHealth::lost) << "scan " << k;
    EXPECT_NEAR(result.T_map_lidar.translation().x(), x_m, 0.35) << "scan " << k;
  }
}

INSTANTIATE_TEST_SUITE_P(Pillars, Corridors,
                         testing::Values(Corridor{.seed = 1, .pillars = 24, .speed_m_s = 5.0},
                                         Corridor{.seed = 2, .pillars = 24, .speed_m_s = 5.0},
                                         Corridor{.seed = 3, .pillars = 24, .speed_m_s = 3.0},
                                         Corridor{.seed = 4, .pillars = 16, .speed_m_s = 3.0},
                                         Corridor{.seed = 5, .pillars = 16, .speed_m_s = 10.0}),
                         [](const auto& instance) {
                           return "Seed" + std::to_string(instance.param.seed);
                         });

}  // namespace
}  // namespace stillmap::test
