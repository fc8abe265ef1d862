#include "core/simulation/simulation.hpp"

#include <tbb/parallel_for.h>

#include <array>
#include <cassert>
#include <cmath>
#include <iomanip>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/prepare.hpp"
#include "core/simulation/city.hpp"
#include "core/simulation/random.hpp"
#include "core/simulation/ray_scene.hpp"
#include "core/simulation/traffic.hpp"

namespace stillmap::simulation {
namespace {

/// Time since the start of a motion at rate 1 that ramps up and down within `ramp_s`, and so ends
/// `duration_s + ramp_s` after its start having advanced by `duration_s`.
double ramped(double time_s, double duration_s, double ramp_s) {
  const auto ramp_up = [ramp_s](double t) {
    if (t <= 0.0) return 0.0;
    return t < ramp_s ? 0.5 * t * t / ramp_s : t - 0.5 * ramp_s;
  };
  return ramp_up(time_s) - ramp_up(time_s - duration_s);
}

/// Quarter turns to one side and the other, with rests of uneven length between them.
double hard_turn_yaw(double time_s) {
  constexpr double rate = 55.0 * rad_per_deg;
  constexpr double turn_s = 90.0 * rad_per_deg / rate;
  constexpr std::array<double, 4> starts_s{2.05, 5.33, 9.71, 13.02};
  constexpr std::array<double, 4> sense{1.0, -1.0, -1.0, 1.0};
  constexpr double cycle_s = 17.0;
  const double in_cycle_s = time_s - cycle_s * std::floor(time_s / cycle_s);
  double yaw = 0.0;
  for (std::size_t k = 0; k < starts_s.size(); ++k)
    yaw += sense[k] * rate * ramped(in_cycle_s - starts_s[k], turn_s, 0.1);
  return yaw;
}

double wave(double time_s, double frequency_hz, double phase) {
  return std::sin(2.0 * std::numbers::pi * frequency_hz * time_s + phase);
}

Eigen::Isometry3d handheld_pose(double time_s) {
  // From standing still, so that the first scans are as sharp as those of a person who starts.
  const double begun = std::min(1.0, time_s / 2.0);
  const double yaw =
      begun * rad_per_deg * (22.0 * wave(time_s, 0.31, 0.4) + 6.0 * wave(time_s, 0.9, 1.0));
  const double pitch =
      begun * rad_per_deg * (3.0 * wave(time_s, 1.8, 0.0) + 2.0 * wave(time_s, 0.43, 2.0));
  const double roll =
      begun * rad_per_deg * (2.5 * wave(time_s, 0.9, 0.3) + 2.0 * wave(time_s, 0.27, 1.1));
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() =
      begun * Eigen::Vector3d(0.02 * wave(time_s, 1.8, 0.5), 0.04 * wave(time_s, 0.9, 0.0),
                              0.03 * wave(time_s, 1.8, 1.2));
  T.linear() = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                   .toRotationMatrix();
  return T;
}

/// Pose of the moving lidar in the frame of the one that is fixed to the vehicle, `time_s` after
/// the first scan. The same for every seed.
Eigen::Isometry3d T_vehicle_lidar_at(LidarMotion motion, double time_s) {
  switch (motion) {
    case LidarMotion::vehicle:
      break;
    case LidarMotion::hard_turns:
      return Eigen::Isometry3d(Eigen::AngleAxisd(hard_turn_yaw(time_s), Eigen::Vector3d::UnitZ()));
    case LidarMotion::handheld:
      return handheld_pose(time_s);
  }
  return Eigen::Isometry3d::Identity();
}

int firings_of(const SimulationConfig& config) {
  if (config.firings > 0) return config.firings;
  return config.sensor.rings > 32 ? 2083 : config.sensor.rings > 16 ? 2170 : 1800;
}

// Measurement of one beam in one firing; range 0: no return.
struct Pixel {
  float range_m = 0.0F;
  float intensity = 0.0F;
  std::uint32_t label = 0;
};

std::vector<const Mesh*> all_meshes(const City& city, const Traffic& traffic) {
  std::vector<const Mesh*> meshes = city.meshes();
  for (const ObjectShape& shape : traffic.shapes()) meshes.push_back(&shape.mesh);
  return meshes;
}

}  // namespace

LidarMotion lidar_motion(const std::string& name) {
  if (name == "vehicle") return LidarMotion::vehicle;
  if (name == "hard_turns") return LidarMotion::hard_turns;
  if (name == "handheld") return LidarMotion::handheld;
  throw std::invalid_argument("no lidar motion '" + name +
                              "': there are vehicle, hard_turns and handheld");
}

struct Simulation::World {
  explicit World(SimulationConfig c)
      : config(std::move(c)),
        day_seed(config.day_seed()),
        ground(config.plan, config.seed),
        city(build_city(ground, config.seed, day_seed)),
        traffic(ground, day_seed, {0.0, (config.scans + 1) * config.sensor.period_s},
                city.instances),
        scene(all_meshes(city, traffic), city.standing_meshes()),
        firings(firings_of(config)) {
    for (int ring = 0; ring < config.sensor.rings; ++ring) {
      const double error = config.flaws.beam(static_cast<std::size_t>(ring)).elevation_error;
      const double elevation = config.sensor.beam_elevation(ring) + error;
      beams.emplace_back(std::cos(elevation), std::sin(elevation));
    }
    for (int firing = 0; firing < firings; ++firing) {
      const double azimuth = azimuth_of(firing);
      azimuths.emplace_back(std::cos(azimuth), std::sin(azimuth));
    }
    static_bodies.emplace_back();
    static_bodies.insert(static_bodies.end(), city.bodies.begin(), city.bodies.end());
  }

  [[nodiscard]] double azimuth_of(int firing) const {
    return 2.0 * std::numbers::pi * firing / firings;
  }

  /// All bodies at a time, in the order of `RayHit::body`.
  [[nodiscard]] std::vector<Body> bodies_at(double time_s) const {
    std::vector<Body> bodies = static_bodies;
    for (const Mover& mover : traffic.movers()) bodies.push_back(traffic.body_at(mover, time_s));
    return bodies;
  }

  [[nodiscard]] std::vector<MovingMesh> motions(double start_s, double end_s) const {
    std::vector<MovingMesh> out;
    for (const Mover& mover : traffic.movers()) {
      const Body start = traffic.body_at(mover, start_s);
      out.push_back({1 + city.shapes.size() + start.shape, start.T_map_body,
                     traffic.body_at(mover, end_s).T_map_body});
    }
    return out;
  }

  [[nodiscard]] Eigen::Isometry3d T_map_lidar_at(double time_s) const {
    // Suspension: pitches with acceleration and vibrates while driving.
    const double dt = 0.2;
    const double v = traffic.ego_speed_at(time_s);
    const double nod =
        -0.006 * (traffic.ego_speed_at(time_s + dt) - traffic.ego_speed_at(time_s - dt)) / (2 * dt);
    const double shake = 0.0015 * std::min(1.0, v / 5.0);
    const double pitch = config.flaws.pitch + nod + shake * std::sin(7.3 * time_s);
    const double roll = config.flaws.roll + shake * std::sin(5.1 * time_s + 1.0);
    Eigen::Isometry3d T_map_lidar = traffic.T_map_ego_at(time_s);
    T_map_lidar.rotate(Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                       Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()));
    // Not even a product with the identity where nothing is asked for: scans keep their bits. The
    // robot turns, whichever way its lidar looks; a hand moves the lidar.
    const Eigen::Isometry3d T_motion = T_vehicle_lidar_at(config.motion, time_s);
    if (config.motion == LidarMotion::hard_turns) T_map_lidar = T_map_lidar * T_motion;
    if (config.T_base_lidar) {
      T_map_lidar = T_map_lidar * *config.T_base_lidar;
    } else {
      T_map_lidar = T_map_lidar * Eigen::Translation3d(0, 0, config.lidar_height_m);
    }
    return config.motion == LidarMotion::handheld ? T_map_lidar * T_motion : T_map_lidar;
  }

  [[nodiscard]] Pixel pixel_of(const RayHit& hit, const std::vector<Body>& bodies, const Ray& ray,
                               std::size_t ring, Random random) const {
    const Body& body = bodies[hit.body];
    const Eigen::Vector3f spot_map = ray.origin_map + hit.range_m * ray.direction_map;
    const SurfaceProperties properties = config.materials.at(hit.surface, spot_map);
    // Patches are fixed to the map; countable objects have none.
    const float patch = body.instance != 0 ? 1.0F : config.materials.patch(spot_map);
    BeamNoise noise = config.noise;
    noise.min_return /= config.flaws.beam(ring).gain;
    const auto seen = beam_return(noise, hit.range_m, hit.cos_incidence, properties,
                                  patch * body.brightness, random);
    if (!seen || seen->range_m < config.sensor.min_range_m ||
        seen->range_m > config.sensor.max_range_m) {
      return {};
    }
    const std::uint32_t label = properties.label != 0 ? properties.label : body.label;
    return {seen->range_m, config.flaws.reported_intensity(seen->intensity, ring),
            label | static_cast<std::uint32_t>(body.instance) << 16U};
  }

  /// Unit vector in the lidar's frame.
  [[nodiscard]] Eigen::Vector3f direction(std::size_t ring, int firing) const {
    const Eigen::Vector2f& level = azimuths[static_cast<std::size_t>(firing)];
    const Eigen::Vector2f& beam = beams[ring];
    return {beam.x() * level.x(), beam.x() * level.y(), beam.y()};
  }

  /// In the lidar's frame.
  [[nodiscard]] Eigen::Vector3f beam_origin(std::size_t ring) const {
    return {0.0F, 0.0F, static_cast<float>(config.flaws.beam(ring).height_m)};
  }

  [[nodiscard]] std::vector<Pixel> fire_revolution(int index) const;
  void mix_edges(int index, std::vector<Pixel>& pixels) const;
  [[nodiscard]] SimulatedScan collect(int index, const std::vector<Pixel>& pixels) const;

  SimulationConfig config;
  std::uint64_t day_seed;
  GroundShape ground;
  City city;
  Traffic traffic;
  RayScene scene;
  int firings;
  /// Cosine and sine of each beam's elevation and of each firing's azimuth.
  std::vector<Eigen::Vector2f> beams, azimuths;
  std::vector<Body> static_bodies;
};

std::vector<Pixel> Simulation::World::fire_revolution(int index) const {
  const double period_s = config.rolling ? config.sensor.period_s : 0.0;
  const double start_s = index * config.sensor.period_s;
  const std::vector<Body> bodies = bodies_at(start_s);
  const RaySnapshot snapshot = scene.with(motions(start_s, start_s + period_s));
  std::vector<Pixel> pixels(beams.size() * static_cast<std::size_t>(firings));
  const Eigen::Isometry3f T_map_start = T_map_lidar_at(start_s).cast<float>();
  // Packets of consecutive firings of one ring: coherent rays.
  const auto fire_some = [&](std::size_t ring, int first, int last) {
    std::array<Ray, RaySnapshot::max_rays> rays;
    std::array<std::size_t, RaySnapshot::max_rays> targets{};
    std::array<std::optional<RayHit>, RaySnapshot::max_rays> hits;
    std::size_t count = 0;
    for (int firing = first; firing < last; ++firing) {
      const double elevation = std::asin(static_cast<double>(beams[ring].y()));
      if (config.flaws.is_blind(azimuth_of(firing), elevation, ring)) continue;
      const double part = static_cast<double>(firing) / firings;
      const Eigen::Isometry3f T_map_lidar =
          config.rolling ? T_map_lidar_at(start_s + part * period_s).cast<float>() : T_map_start;
      rays[count] = {T_map_lidar * beam_origin(ring),
                     T_map_lidar.linear() * direction(ring, firing),
                     static_cast<float>(config.sensor.max_range_m), static_cast<float>(part)};
      targets[count++] =
          ring * static_cast<std::size_t>(firings) + static_cast<std::size_t>(firing);
    }
    snapshot.cast(std::span(rays).first(count), std::span(hits).first(count));
    for (std::size_t i = 0; i < count; ++i) {
      const Random random(day_seed, 41, static_cast<std::uint64_t>(index), targets[i]);
      if (hits[i]) pixels[targets[i]] = pixel_of(*hits[i], bodies, rays[i], ring, random);
    }
  };
  constexpr int some = RaySnapshot::max_rays;
  tbb::parallel_for(0, (firings + some - 1) / some, [&](int block) {
    for (std::size_t ring = 0; ring < beams.size(); ++ring) {
      fire_some(ring, some * block, std::min(firings, some * (block + 1)));
    }
  });
  mix_edges(index, pixels);
  return pixels;
}

// Mixed pixels: a beam that hits two surfaces reports a range between theirs.
void Simulation::World::mix_edges(int index, std::vector<Pixel>& pixels) const {
  if (config.flaws.mixed_share == 0.0) return;
  constexpr float min_step_m = 0.3F;
  constexpr float max_step_m = 3.0F;
  for (std::size_t i = 0; i + 1 < pixels.size(); ++i) {
    const float step_m = pixels[i + 1].range_m - pixels[i].range_m;
    const bool is_edge = std::abs(step_m) > min_step_m && std::abs(step_m) < max_step_m;
    if (!is_edge || pixels[i].range_m == 0.0F || pixels[i + 1].range_m == 0.0F) continue;
    Random random(day_seed, 42, static_cast<std::uint64_t>(index), i);
    if (!random.chance(config.flaws.mixed_share)) continue;
    pixels[i].range_m += static_cast<float>(random.uniform()) * step_m;
  }
}

SimulatedScan Simulation::World::collect(int index, const std::vector<Pixel>& pixels) const {
  SimulatedScan out;
  const double start_s = index * config.sensor.period_s;
  out.stamp_ns = std::llround(start_s * 1e9);
  out.T_map_lidar = T_map_lidar_at(start_s);
  out.scan.stamp_ns = out.stamp_ns;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const Pixel& pixel = pixels[i];
    if (pixel.range_m <= 0.0F) continue;
    const std::size_t ring = i / static_cast<std::size_t>(firings);
    const auto firing = static_cast<int>(i % static_cast<std::size_t>(firings));
    out.scan.points_lidar.emplace_back(pixel.range_m * direction(ring, firing) + beam_origin(ring));
    out.scan.intensity.push_back(pixel.intensity);
    out.scan.ring.push_back(static_cast<std::uint16_t>(ring));
    out.scan.labels.push_back(
        class_from_semantic_kitti(static_cast<std::uint16_t>(pixel.label & 0xFFFFU)));
    out.raw_labels.push_back(pixel.label);
    if (config.rolling) {
      out.scan.time_offset_s.push_back(
          static_cast<float>(config.sensor.period_s * firing / firings));
    }
  }
  // As the real one measures, of which the sensor's file says it.
  turn_up(out.scan, -config.sensor.elevation_offset);
  return out;
}

std::uint64_t SimulationConfig::day_seed() const {
  constexpr std::uint64_t stream = 51;
  return day == 0 ? seed : Random(seed, stream, day).index(1U << 30U);
}

std::string SimulationConfig::faults() const {
  std::string out = plan.faults() + sensor.faults() + noise.faults() + flaws.faults(sensor);
  const auto check = [&](double value, double low, double high, const char* field) {
    if (value >= low && value <= high) return;
    std::ostringstream text;
    text << std::setprecision(10) << "simulation." << field << " is " << value << ", must be "
         << low << " to " << high << '\n';
    out += text.str();
  };
  if (sensor.pattern != ScanPattern::rings)
    out += "simulation.sensor '" + sensor.name +
           "' has no rings: only lidars that turn are simulated\n";
  check(scans, 1, 100000, "scans");
  check(firings, 0, 10000, "firings");
  check(lidar_height_m, 0.3, 4.0, "lidar_height_m");
  if (T_base_lidar) check(T_base_lidar->translation().z(), 0.3, 4.0, "T_base_lidar.z");
  return out;
}

Simulation::Simulation(SimulationConfig config) {
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument("The simulation cannot run:\n" + faults);
  }
  world_ = std::make_unique<World>(std::move(config));
}

Simulation::~Simulation() = default;

const SimulationConfig& Simulation::config() const { return world_->config; }

SimulatedScan Simulation::scan(int index) const {
  assert(index >= 0 && index < world_->config.scans);
  return world_->collect(index, world_->fire_revolution(index));
}

Eigen::Isometry3d Simulation::T_map_lidar_at(double time_s) const {
  return world_->T_map_lidar_at(time_s);
}

}  // namespace stillmap::simulation
