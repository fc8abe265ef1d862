#include <gtest/gtest.h>

#include <random>
#include <string>

#include "tests/odometry/unlabelled_drive.hpp"

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

/// Rings lie on smooth walls as in the scan before, wherever the lidar has gone: by them it stands
/// still, though a third of its points are on pillars that pass by.
TEST_P(Corridors, ALidarThatSetsOffBetweenPillarsIsFollowed) {
  const auto T_world_lidar = [](int k) {
    return Eigen::Translation3d(0.0, 0.2, 0.0) * setting_off(k, GetParam().speed_m_s);
  };
  follow_unlabelled(
      GetParam().world(), lidar(), 40, T_world_lidar,
      [](const Eigen::Isometry3d& off) { EXPECT_NEAR(off.translation().x(), 0.0, 0.35); });
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
