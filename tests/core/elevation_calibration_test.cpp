#include "core/elevation_calibration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "core/lidar/prepare.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap {
namespace {

using simulation::Simulation;
using simulation::SimulationConfig;

constexpr double degree = std::numbers::pi / 180.0;

/// A drive through the yard with a lidar whose elevations are `low` too low [rad].
ElevationCalibration calibration_of(double low, std::size_t step_of_scans) {
  SimulationConfig simulated;
  simulated.plan = simulation::test_yard();
  simulated.seed = 5;
  simulated.sensor = hdl_64e();
  simulated.firings = 450;
  simulated.scans = 30;
  const Simulation simulation(simulated);
  MapperConfig mapper;
  mapper.sensor = simulated.sensor;
  const ElevationCalibrationConfig config{.reach = 0.4 * degree, .step = 0.2 * degree};
  const auto scan_at = [&](std::size_t k) {
    Scan scan = simulation.scan(static_cast<int>(k * step_of_scans)).scan;
    scan.stamp_ns = static_cast<std::int64_t>(k) * 100'000'000;
    turn_up(scan, -low);
    return scan;
  };
  return calibrate_elevation(mapper, 30, scan_at, config);
}

TEST(ElevationCalibration, FindsByHowMuchElevationsAreOff) {
  for (const double low : {0.2 * degree, -0.15 * degree}) {
    const ElevationCalibration found = calibration_of(low, 1);
    ASSERT_TRUE(found.offset);
    EXPECT_NEAR(*found.offset / degree, low / degree, 0.08);
    EXPECT_GT(found.saving, 0.0);
  }
}

TEST(ElevationCalibration, IsNotToldByALidarThatStands) {
  EXPECT_FALSE(calibration_of(0.2 * degree, 0).offset);
}

}  // namespace
}  // namespace stillmap
