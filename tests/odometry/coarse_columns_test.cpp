#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "core/odometry/ring_order.hpp"
#include "tests/odometry/unlabelled_drive.hpp"

namespace stillmap::test {
namespace {

/// A lidar whose columns are farther apart than usual, and how it drives.
struct CoarseLidar {
  int rings = 32;
  int columns = 360;
  double speed_m_s = 0.0;

  [[nodiscard]] SensorModel sensor() const {
    SensorModel sensor = test_lidar();
    sensor.rings = rings;
    sensor.columns = columns;
    sensor.fov_up = 15.0 * std::numbers::pi / 180.0;
    sensor.fov_down = -15.0 * std::numbers::pi / 180.0;
    return sensor;
  }
};

/// A ring of so many rays round the lidar, each of which returns so often.
std::vector<Eigen::Vector3f> ring_of(int rays, int returns, double share_that_return = 1.0) {
  std::mt19937 random(1);
  std::bernoulli_distribution does_return(share_that_return);
  std::vector<Eigen::Vector3f> ring;
  for (int k = 0; k < rays; ++k) {
    const float angle_rad =
        2.0F * std::numbers::pi_v<float> * static_cast<float>(k) / static_cast<float>(rays);
    if (!does_return(random)) continue;
    for (int n = 0; n < returns; ++n)
      ring.emplace_back((9.0F + static_cast<float>(n)) *
                        Eigen::Vector3f(std::cos(angle_rad), std::sin(angle_rad), 0.0F));
  }
  return ring;
}

TEST(RayStep, IsThatOfTheRaysWhateverReturns) {
  constexpr double step_rad = 2.0 * std::numbers::pi / 1800.0;
  EXPECT_NEAR(ray_step_rad(ring_of(1800, 1)), step_rad, 0.02 * step_rad);
  // Most steps are gaps of several rays.
  EXPECT_NEAR(ray_step_rad(ring_of(1800, 1, 0.25)), step_rad, 0.02 * step_rad);
  EXPECT_NEAR(ray_step_rad(ring_of(225, 2)), 8.0 * step_rad, 0.16 * step_rad);
  EXPECT_EQ(ray_step_rad(std::vector<Eigen::Vector3f>(3, Eigen::Vector3f::Zero())), 0.0F);
  EXPECT_EQ(ray_step_rad({}), 0.0F);
}

class CoarseColumns : public testing::TestWithParam<CoarseLidar> {};

/// Between columns 0.81 degrees apart every surface may be a grazed one, of which no scan begins a
/// map, and a flat wall seen at an angle an edge.
TEST_P(CoarseColumns, ALidarThatSetsOffInAStreetIsFollowed) {
  const auto T_world_lidar = [](int k) { return setting_off(k, GetParam().speed_m_s); };
  follow_unlabelled(
      street(), GetParam().sensor(), 30, T_world_lidar,
      [](const Eigen::Isometry3d& off) { EXPECT_NEAR(off.translation().x(), 0.0, 0.05); });
}

/// Columns on smooth walls go along with the lidar: only the rings' directions tell that it drives.
INSTANTIATE_TEST_SUITE_P(DenseLidars, CoarseColumns,
                         testing::Values(CoarseLidar{.rings = 48, .columns = 360, .speed_m_s = 8.0},
                                         CoarseLidar{.rings = 48, .columns = 512, .speed_m_s = 1.0},
                                         CoarseLidar{.rings = 64, .columns = 512, .speed_m_s = 8.0},
                                         CoarseLidar{
                                             .rings = 128, .columns = 1024, .speed_m_s = 3.0}),
                         [](const auto& instance) {
                           return std::to_string(instance.param.rings) + "RingsOf" +
                                  std::to_string(instance.param.columns);
                         });

INSTANTIATE_TEST_SUITE_P(Lidars, CoarseColumns,
                         testing::Values(CoarseLidar{.columns = 360, .speed_m_s = 8.0},
                                         CoarseLidar{.columns = 450, .speed_m_s = 1.0},
                                         CoarseLidar{.rings = 16, .columns = 360, .speed_m_s = 1.0},
                                         CoarseLidar{.rings = 16, .columns = 240, .speed_m_s = 8.0},
                                         CoarseLidar{.rings = 8, .columns = 450, .speed_m_s = 8.0}),
                         [](const auto& instance) {
                           return std::to_string(instance.param.rings) + "RingsOf" +
                                  std::to_string(instance.param.columns);
                         });

}  // namespace
}  // namespace stillmap::test
