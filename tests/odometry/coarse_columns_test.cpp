#include <gtest/gtest.h>

#include <numbers>
#include <string>

#include "core/odometry/odometry.hpp"
#include "tests/odometry/box_world.hpp"
#include "tests/odometry/register_scan.hpp"

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

class CoarseColumns : public testing::TestWithParam<CoarseLidar> {};

/// From columns 0.81 degrees apart on every surface was a grazed one, and no scan could begin a
/// map; a flat wall seen at an angle was an edge long before.
TEST_P(CoarseColumns, ALidarThatSetsOffInAStreetIsFollowed) {
  const BoxWorld world = street();
  const SensorModel sensor = GetParam().sensor();
  OdometryConfig config;
  config.weighting = Weighting::geometric;
  Odometry odometry(config, sensor);
  double x_m = 0.0;
  for (int k = 0; k < 30; ++k) {
    x_m += 0.1 * GetParam().speed_m_s * std::min(1.0, 0.1 * k);
    Scan scan =
        world.scan(sensor, Eigen::Isometry3d(Eigen::Translation3d(x_m, 0.0, 0.0)), 0.1 * k).scan;
    scan.labels.clear();
    const OdometryResult result = register_scan(odometry, std::move(scan), {}).result;
    ASSERT_NE(result.health, OdometryHealth::lost) << "scan " << k;
    EXPECT_NEAR(result.T_map_lidar.translation().x(), x_m, 0.05) << "scan " << k;
  }
}

/// Columns on smooth walls go along with the lidar: without the rings' directions in a map's first
/// scans, dense lidars were held to stand to the end, `good`.
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
