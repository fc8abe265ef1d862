#include "core/simulation/simulated_gnss.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/geodesy/east_north_up.hpp"

namespace stillmap::simulation {
namespace {

SimulationConfig yard_drive() {
  SimulationConfig config;
  config.plan = test_yard();
  config.scans = 600;
  return config;
}

/// In the city's frame [m].
std::vector<Eigen::Vector3d> errors_of(const std::vector<GnssFix>& fixes,
                                       const Simulation& simulation) {
  const EastNorthUp city(city_latitude_deg, city_longitude_deg, city_altitude_m);
  std::vector<Eigen::Vector3d> errors;
  for (const GnssFix& fix : fixes) {
    const double time_s = 1e-9 * static_cast<double>(fix.stamp_ns);
    errors.push_back(city.position_enu(fix) - simulation.T_map_lidar_at(time_s).translation());
  }
  return errors;
}

TEST(SimulatedGnss, IsWhereTheLidarIsWithoutErrors) {
  const Simulation simulation(yard_drive());
  const auto fixes = simulated_gnss(simulation, {.wander_m = 0.0});
  ASSERT_EQ(fixes.size(), 301U);
  for (const Eigen::Vector3d& error : errors_of(fixes, simulation)) EXPECT_LT(error.norm(), 1e-6);
}

TEST(SimulatedGnss, ErrsByTheSameForAWhile) {
  const Simulation simulation(yard_drive());
  const auto fixes =
      simulated_gnss(simulation, {.wander_m = 2.0, .noise_share = 0.0, .reflections_an_hour = 0.0});
  EXPECT_EQ(fixes.front().covariance_enu(0, 0), 4.0);
  const auto errors = errors_of(fixes, simulation);
  double largest_step_m = 0.0;
  double mean_m = 0.0;
  for (std::size_t k = 1; k < errors.size(); ++k) {
    largest_step_m = std::max(largest_step_m, (errors[k] - errors[k - 1]).head<2>().norm());
    mean_m += errors[k].head<2>().norm() / static_cast<double>(errors.size());
  }
  EXPECT_LT(largest_step_m, 1.0);
  EXPECT_GT(mean_m, 0.3);
  EXPECT_EQ(simulated_gnss(simulation)[7].latitude_deg, simulated_gnss(simulation)[7].latitude_deg);
}

TEST(SimulatedGnss, ErrsOtherwiseOnAnotherDay) {
  SimulationConfig tuesday = yard_drive();
  tuesday.day = 1;
  const Simulation first(yard_drive()), second(tuesday);
  const auto monday_errors = errors_of(simulated_gnss(first), first);
  const auto tuesday_errors = errors_of(simulated_gnss(second), second);
  EXPECT_GT((monday_errors.front() - tuesday_errors.front()).norm(), 0.1);
}

TEST(SimulatedGnss, ReflectionsComeInStretchesAndTheFixDoesNotKnow) {
  const Simulation simulation(yard_drive());
  const auto fixes = simulated_gnss(simulation, {.wander_m = 0.1,
                                                 .noise_share = 0.0,
                                                 .reflections_an_hour = 600.0,
                                                 .reflection_s = 2.0,
                                                 .reflection_factor = 200.0});
  std::size_t far = 0;
  for (const Eigen::Vector3d& error : errors_of(fixes, simulation))
    far += error.norm() > 3.0 ? 1U : 0U;
  EXPECT_GT(far, fixes.size() / 20);
  EXPECT_LT(far, fixes.size() / 2);
  for (const GnssFix& fix : fixes) EXPECT_NEAR(fix.covariance_enu(0, 0), 0.01, 1e-12);
}

}  // namespace
}  // namespace stillmap::simulation
