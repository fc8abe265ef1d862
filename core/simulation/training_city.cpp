#include "core/simulation/training_city.hpp"

#include <algorithm>
#include <cmath>

#include "core/lidar/angle_units.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector2d;

constexpr double min_spacing_m = 8.0;
// Long enough for one round of the longest route.
constexpr int sequence_scans = 900;

// Evenly spaced beams over a random field of view.
SensorModel random_sensor(Random& random) {
  SensorModel sensor;
  sensor.name = "evenly spaced";
  sensor.rings = random.chance(0.5) ? 64 : 32;
  sensor.fov_up = random.uniform(2.0, 22.0) * rad_per_deg;
  sensor.fov_down = -random.uniform(14.0, 32.0) * rad_per_deg;
  return sensor;
}

SensorModel any_sensor(Random& random) {
  const double kind = random.uniform();
  if (kind < 0.6) return hdl_64e();
  if (kind < 0.8) return vlp_16();
  return kind < 0.9 ? hdl_32e() : random_sensor(random);
}

BeamNoise random_noise(Random& random) {
  // Of most lidars below a centimetre.
  const double noisy = random.uniform();
  return {.range_sigma_m = 0.004 + 0.04 * noisy * noisy * noisy,
          .drop_share = random.chance(0.3) ? random.uniform(0.0, 0.1) : random.uniform(0.0, 0.02),
          .intensity_sigma = random.uniform(0.005, 0.09),
          .min_return = 1.2e-5 * std::exp(random.uniform(-1.0, 1.4))};
}

// A sequence as `stillmap simulate` makes it by default.
SimulationConfig plain_sequence(std::uint64_t seed, Random& random) {
  SimulationConfig config;
  config.plan = random.chance(0.5) ? quiet_city() : crowded_avenue();
  config.seed = seed;
  config.sensor = random.chance(0.75) ? hdl_64e() : vlp_16();
  config.scans = sequence_scans;
  return config;
}

// Roads in the country often end in grass.
StreetProfile random_profile(Random& random, bool is_country) {
  StreetProfile profile;
  const double size = random.uniform();
  profile.lanes = size < 0.9 ? 1 : size < 0.98 ? 2 : 3;
  profile.half_median_m = random.chance(0.2) ? random.uniform(0.5, 5.0) : 0.0;
  profile.lane_width_m = random.uniform(2.2, random.chance(0.3) ? 4.5 : 3.2);
  profile.bike_lane_m = random.chance(0.3) ? random.uniform(1.0, 1.8) : random.uniform(0.0, 0.5);
  const double parking = random.uniform();
  profile.has_bays = parking > 0.7;
  profile.parking_m = parking > 0.35 ? random.uniform(2.0, 2.6) : 0.0;
  if (parking > 0.87) profile.parking_m = random.uniform(4.4, 5.6);
  profile.verge_m = random.chance(0.5) ? random.uniform(0.6, 6.0) : 0.0;
  profile.sidewalk_m = random.chance(is_country ? 0.6 : 0.06)
                           ? 0.0
                           : random.uniform(1.5, random.chance(0.6) ? 9.0 : 4.0);
  return profile;
}

// A ring of streets round one block, perhaps crossed by a side street of another kind.
void draw_streets(CityPlan& plan, Random& random, bool is_country) {
  plan.route_profile = random_profile(random, is_country);
  const double half = plan.route_profile.half_street_m();
  plan.turn_radius_m = plan.route_profile.bike_centre_m() + 3.0;
  const double min_side_m = std::max(2.0 * plan.turn_radius_m + 30.0, 2.0 * half + 30.0);
  const double width = min_side_m + random.uniform(20.0, 90.0);
  const double depth = min_side_m + random.uniform(0.0, 50.0);
  plan.streets_along_v = {{0.0, plan.route_profile}, {width, plan.route_profile}};
  plan.streets_along_u = {{0.0, plan.route_profile}, {depth, plan.route_profile}};
  plan.route = {{0, 0}, {width, 0}, {width, depth}, {0, depth}};
  StreetProfile side = random_profile(random, is_country);
  side.lanes = 1;
  side.half_median_m = 0.0;
  const double middle = width * random.uniform(0.4, 0.6);
  const double room = std::min(middle, width - middle) - half - side.half_street_m();
  if (random.chance(0.5) && room > 15.0) {
    plan.streets_along_v.insert(plan.streets_along_v.begin() + 1, {middle, side});
  }
  if (random.chance(0.5)) plan.crossings.emplace_back(0.25 * width, 0.0);
  if (random.chance(0.3)) plan.crossings.emplace_back(0.0, 0.5 * depth);
}

void draw_ground(CityPlan& plan, Random& random, bool is_country) {
  plan.margin_m = random.uniform(45.0, 65.0);
  plan.bend_length_m = random.uniform(45.0, 120.0);
  plan.bend_m = random.chance(0.3) ? 0.0 : random.uniform(0.0, 0.15) * plan.bend_length_m;
  plan.hill_length_m = random.uniform(40.0, 100.0);
  plan.hill_m = random.chance(0.3) ? 0.1 : random.uniform(0.0, 0.05) * plan.hill_length_m;
  plan.kerb_m = random.chance(is_country ? 0.75 : 0.1) ? 0.0 : random.uniform(0.02, 0.2);
  plan.share_driveways = random.chance(0.6) ? random.uniform(0.1, 0.8) : 0.0;
  plan.share_paved_yards = is_country || random.chance(0.4) ? 0.0 : random.uniform();
  plan.embankment_m = random.chance(0.5) ? random.uniform(0.3, 3.5) : 0.0;
  plan.tufts_m = random.chance(0.5) ? 0.0 : random.uniform(0.0, 0.08);
  plan.paved_medians = random.chance(0.2);
  plan.lane_lines = random.chance(0.6);
  plan.edge_lines = random.chance(is_country ? 0.7 : 0.3);
}

// Car parks and gravel yards beside the streets.
void draw_patches(CityPlan& plan, Random& random) {
  const double half = plan.route_profile.half_street_m();
  const double width = plan.streets_along_v.back().position_m;
  const double depth = plan.streets_along_u.back().position_m;
  const std::size_t count = random.index(3);
  for (std::size_t i = 0; i < count; ++i) {
    const double u = random.uniform(half, width - half - 12.0);
    const bool beyond = random.chance(0.5);
    const double far = random.uniform(12.0, 28.0);
    const double edge = beyond ? depth + half + 0.5 : -half - 0.5 - far;
    const double inner = random.chance(0.5) ? half + 0.5 : edge;
    const Vector2d low(u, inner);
    const Vector2d high(u + random.uniform(12.0, 40.0), inner + far);
    plan.patches.push_back(
        {Eigen::AlignedBox2d(low, high), random.chance(0.5) ? Zone::parking : Zone::other});
  }
}

// Houses stand at the sidewalk in the middle of a town, behind gardens in its suburbs; roads in the
// country show few or none.
void draw_blocks(CityPlan& plan, Random& random, bool is_country) {
  BlockPlan& blocks = plan.blocks;
  const bool suburb = random.chance(0.5);
  const bool at_sidewalk = !suburb && random.chance(0.6);
  blocks.setback_min_m = suburb ? random.uniform(1.0, 6.0) : random.uniform(0.0, 2.0);
  blocks.setback_max_m = blocks.setback_min_m + random.uniform(0.5, suburb ? 12.0 : 3.0);
  if (at_sidewalk) {
    blocks.setback_min_m = 0.0;
    blocks.setback_max_m = random.uniform(0.0, 0.3);
  }
  blocks.gap_max_m = suburb ? random.uniform(2.0, 18.0) : random.uniform(0.0, 4.0);
  blocks.floors_min = 1 + static_cast<int>(random.index(2));
  blocks.floors_max = blocks.floors_min + static_cast<int>(random.index(suburb ? 3 : 5));
  blocks.trees_per_100m = random.uniform(2.0, 22.0);
  blocks.garden_trees_per_100m = random.uniform(10.0, 90.0);
  blocks.share_fence = random.uniform(0.15, 0.7);
  blocks.share_hedge = random.uniform(0.1, 0.95 - blocks.share_fence);
  blocks.share_thicket = random.uniform(0.0, 0.95 - blocks.share_fence - blocks.share_hedge);
  blocks.share_wall = 0.95 - blocks.share_fence - blocks.share_hedge - blocks.share_thicket;
  if (random.chance(0.5)) blocks.share_wall *= random.uniform();
  if (at_sidewalk) {
    for (double* share : {&blocks.share_fence, &blocks.share_hedge, &blocks.share_thicket,
                          &blocks.share_wall, &blocks.garden_trees_per_100m})
      *share *= 0.2;
  }
  const double houses = is_country ? random.uniform(0.0, 0.5) : random.uniform(0.5, 1.0);
  blocks.share_open = (1.0 - houses) * random.uniform();
  blocks.share_wood = 1.0 - houses - blocks.share_open;
  blocks.share_barrier = random.uniform(0.0, 0.6);
  blocks.share_halls = random.chance(0.3) ? houses * random.uniform(0.0, 0.4) : 0.0;
}

void draw_traffic(CityPlan& plan, Random& random) {
  plan.traffic = {
      .vehicles_per_km = random.uniform(0.0, 35.0),
      .share_trucks = random.uniform(0.0, 0.2),
      .share_buses = random.uniform(0.0, 0.1),
      .cyclists_per_km = random.uniform(0.0, 35.0),
      .pedestrians_per_km = random.uniform(0.0, 40.0),
      .crossing_pedestrians = static_cast<int>(random.index(8)),
      .speed_mps = random.uniform(7.0, 13.0),
      .light_red_s = random.uniform(4.0, 12.0),
      .parked_per_100m = random.chance(0.15) ? 0 : 4 + static_cast<int>(random.index(12)),
      .share_motorcyclists = random.uniform(0.0, 0.5),
      .share_other_vehicles = random.uniform(0.0, 0.12),
      .groups_per_100m = random.uniform(0.0, 3.0)};
  plan.parking = {.share_motorcycles = random.uniform(0.0, 0.12),
                  .share_trucks = random.uniform(0.0, 0.3),
                  .share_buses = random.uniform(0.0, 0.06),
                  .share_other_vehicles = random.uniform(0.0, 0.12),
                  .share_bicycles = random.uniform(0.0, 0.3)};
}

// Streets, slopes, blocks, traffic and furniture are all drawn; rare things (two-wheelers, buses,
// signs) are more frequent than in real cities.
CityPlan training_plan(Random random) {
  CityPlan plan;
  plan.name = "training";
  plan.many_shapes = true;
  const bool is_country = random.chance(0.35);
  draw_streets(plan, random, is_country);
  draw_ground(plan, random, is_country);
  draw_patches(plan, random);
  draw_blocks(plan, random, is_country);
  draw_traffic(plan, random);
  plan.ego_lane =
      static_cast<int>(random.index(static_cast<std::size_t>(plan.route_profile.lanes)));
  return plan;
}

}  // namespace

SimulationConfig training_sequence(std::uint64_t seed, double share_of_plain) {
  Random random(seed, 91);
  if (random.chance(share_of_plain)) return plain_sequence(seed, random);
  SimulationConfig config;
  config.plan = training_plan(Random(seed, 92));
  config.seed = seed;
  config.sensor = any_sensor(random);
  config.sensor.max_range_m = random.uniform(60.0, 120.0);
  config.sensor.min_range_m = random.uniform(0.5, 1.5);
  config.scans = sequence_scans;
  const bool low_mount = config.sensor.rings <= 16;
  config.lidar_height_m = random.uniform(low_mount ? 0.4 : 1.4, 2.2);
  config.noise = random_noise(random);
  config.flaws = random_flaws(config.sensor, Random(seed, 93));
  config.materials = random_materials(Random(seed, 94));
  return config;
}

SimulationConfig any_sequence(std::uint64_t seed, const SensorModel& sensor) {
  SimulationConfig config = training_sequence(seed, 0.0);
  config.sensor = sensor;
  config.flaws = random_flaws(sensor, Random(seed, 93));
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
