#include "core/simulation/training_city.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stillmap::simulation {
namespace {

constexpr double degree = std::numbers::pi / 180.0;
constexpr double min_spacing_m = 8.0;
// Of a drive; long enough to come round the longest route.
constexpr int drive_scans = 900;

// Evenly spaced beams over a field of view that no sensor of ours has.
SensorModel random_sensor(Random& random) {
  SensorModel sensor;
  sensor.name = "evenly spaced";
  sensor.rings = random.chance(0.5) ? 64 : 32;
  sensor.fov_up = random.uniform(2.0, 22.0) * degree;
  sensor.fov_down = -random.uniform(14.0, 32.0) * degree;
  return sensor;
}

SensorModel any_sensor(Random& random) {
  const double kind = random.uniform();
  if (kind < 0.6) return hdl_64e();
  if (kind < 0.8) return vlp_16();
  return kind < 0.9 ? hdl_32e() : random_sensor(random);
}

BeamNoise random_noise(Random& random) {
  return {.range_sigma_m = random.uniform(0.005, 0.05),
          .drop_share = random.chance(0.3) ? random.uniform(0.0, 0.1) : random.uniform(0.0, 0.02),
          .intensity_sigma = random.uniform(0.005, 0.09),
          .min_return = 1.2e-5 * std::exp(random.uniform(-1.0, 1.4))};
}

// A drive as `stillmap simulate` makes it by default.
SimulationConfig plain_drive(std::uint64_t seed, Random& random) {
  SimulationConfig config;
  config.plan = random.chance(0.5) ? quiet_city() : crowded_avenue();
  config.seed = seed;
  config.sensor = random.chance(0.75) ? hdl_64e() : vlp_16();
  config.scans = drive_scans;
  return config;
}

}  // namespace

SimulationConfig training_sequence(std::uint64_t seed, double share_of_plain) {
  Random random(seed, 91);
  if (random.chance(share_of_plain)) return plain_drive(seed, random);
  SimulationConfig config;
  config.plan = training_plan(Random(seed, 92));
  config.seed = seed;
  config.sensor = any_sensor(random);
  config.sensor.max_range_m = random.uniform(60.0, 120.0);
  config.sensor.min_range_m = random.uniform(0.5, 1.5);
  config.scans = drive_scans;
  const bool low_mount = config.sensor.rings <= 16;
  config.lidar_height_m = random.uniform(low_mount ? 0.4 : 1.4, 2.2);
  config.noise = random_noise(random);
  config.flaws = random_flaws(config.sensor, Random(seed, 93));
  config.materials = random_materials(Random(seed, 94));
  return config;
}

std::vector<int> spread_scans(const Simulation& sequence, int count) {
  const double period_s = sequence.config().sensor.period_s;
  const auto place = [&](int scan) {
    return Eigen::Vector3d(sequence.T_map_lidar_at(scan * period_s).translation());
  };
  double way_m = 0.0;
  for (int scan = 1; scan < sequence.config().scans; ++scan)
    way_m += (place(scan) - place(scan - 1)).norm();
  const double apart_m = std::max(min_spacing_m, 0.95 * way_m / count);
  std::vector<int> chosen{0};
  double since_m = 0.0;
  for (int scan = 1; scan < sequence.config().scans && std::ssize(chosen) < count; ++scan) {
    since_m += (place(scan) - place(scan - 1)).norm();
    if (since_m < apart_m) continue;
    chosen.push_back(scan);
    since_m = 0.0;
  }
  return chosen;
}

}  // namespace stillmap::simulation
