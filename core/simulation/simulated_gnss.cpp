#include "core/simulation/simulated_gnss.hpp"

#include <cmath>

#include "core/geodesy/east_north_up.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {
namespace {

/// Heights are known half as well.
const Eigen::Vector3d shape(1.0, 1.0, 2.0);

Eigen::Vector3d random_vector(Random& random) {
  const double x = random.normal();
  const double y = random.normal();
  return Eigen::Vector3d(x, y, random.normal()).cwiseProduct(shape);
}

}  // namespace

std::vector<GnssFix> simulated_gnss(const Simulation& simulation, const GnssErrors& errors) {
  const SimulationConfig& config = simulation.config();
  const EastNorthUp city(city_latitude_deg, city_longitude_deg, city_altitude_m);
  const double step_s = 1.0 / errors.rate_hz;
  const double kept = std::exp(-step_s / errors.wander_time_s);
  const auto count = static_cast<std::uint64_t>(config.scans * config.sensor.period_s / step_s);
  Random start(config.day_seed(), 61);
  Eigen::Vector3d wander_city = errors.wander_m * random_vector(start);
  Eigen::Vector3d reflection_city = Eigen::Vector3d::Zero();
  double reflection_ends_s = 0.0;
  std::vector<GnssFix> fixes;
  for (std::uint64_t k = 0; k <= count; ++k) {
    Random random(config.day_seed(), 62, k);
    const double time_s = static_cast<double>(k) * step_s;
    // First-order Gauss-Markov: its deviation stays that of the wander.
    wander_city =
        kept * wander_city + std::sqrt(1.0 - kept * kept) * errors.wander_m * random_vector(random);
    if (random.chance(errors.reflections_an_hour / 3600.0 * step_s)) {
      reflection_ends_s = time_s + errors.reflection_s;
      reflection_city = errors.reflection_factor * errors.wander_m * random_vector(random);
    }
    Eigen::Vector3d position_city = simulation.T_map_lidar_at(time_s).translation() + wander_city +
                                    errors.noise_share * errors.wander_m * random_vector(random);
    if (time_s < reflection_ends_s) position_city += reflection_city;
    GnssFix fix = city.fix_at(position_city);
    fix.stamp_ns = std::llround((time_s + errors.delay_s) * 1e9);
    fix.covariance_enu = (errors.wander_m * shape).cwiseAbs2().asDiagonal();
    fixes.push_back(fix);
  }
  return fixes;
}

}  // namespace stillmap::simulation
