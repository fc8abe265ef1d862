#include "core/simulation/lidar_flaws.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "core/lidar/angle_units.hpp"

namespace stillmap::simulation {
namespace {

// The HDL-64E has two laser blocks above its origin; the beams of smaller sensors share one origin.
double block_height(std::size_t ring, std::size_t rings, double upper_m, double lower_m) {
  return 2 * ring < rings ? upper_m : lower_m;
}

std::vector<BeamFlaw> random_beams(const SensorModel& sensor, Random& random) {
  const auto rings = static_cast<std::size_t>(sensor.rings);
  const bool two_blocks = sensor.rings > 32 && !sensor.beam_elevations.empty();
  const double error =
      (two_blocks ? random.uniform(0.04, 0.1) : random.uniform(0.0, 0.06)) * rad_per_deg;
  const double spread = random.uniform(0.0, random.chance(0.6) ? 0.12 : 0.3);
  const double upper_m = two_blocks ? random.uniform(0.05, 0.17) : 0.0;
  const double lower_m = two_blocks ? random.uniform(0.02, 0.14) : 0.0;
  const double share_weak = random.uniform(0.0, 0.12);
  std::vector<BeamFlaw> beams;
  for (std::size_t ring = 0; ring < rings; ++ring) {
    const double weak = random.chance(share_weak) ? random.uniform(0.1, 0.5) : 1.0;
    beams.push_back({.elevation_error = error * random.normal(),
                     .height_m = block_height(ring, rings, upper_m, lower_m),
                     .gain = weak * std::exp(spread * random.normal())});
  }
  return beams;
}

std::vector<BlindSpot> random_blind_spots(const SensorModel& sensor, Random& random) {
  std::vector<BlindSpot> spots;
  if (random.chance(0.35)) return spots;
  const std::size_t count = 1 + random.index(7);
  for (std::size_t i = 0; i < count; ++i) {
    spots.push_back({.azimuth = random.uniform(-std::numbers::pi, std::numbers::pi),
                     .elevation = sensor.fov_down + random.uniform(-0.04, 0.12),
                     .half_width = random.uniform(0.03, 0.5),
                     .half_height = random.uniform(0.03, 0.13)});
  }
  return spots;
}

}  // namespace

BeamFlaw LidarFlaws::beam(std::size_t ring) const {
  return beams.empty() ? BeamFlaw{} : beams[ring];
}

bool LidarFlaws::is_blind(double azimuth, double elevation, std::size_t ring) const {
  return std::ranges::any_of(blind_spots, [&](const BlindSpot& spot) {
    const double up = (elevation - spot.elevation) / spot.half_height;
    if (std::abs(up) >= 1.0) return false;
    const double turn = std::remainder(azimuth - spot.azimuth, 2.0 * std::numbers::pi);
    const double ragged =
        Random(81, ring, static_cast<std::uint64_t>(turn > 0)).uniform(0.75, 1.15);
    const double across = turn / (ragged * spot.half_width);
    return across * across + up * up < 1.0;
  });
}

float LidarFlaws::reported_intensity(float intensity, std::size_t ring) const {
  if (intensity < intensity_floor) return 0.0F;
  const double bright = beam(ring).gain * intensity_gain * std::pow(intensity, intensity_gamma);
  double reported = std::clamp(bright + intensity_offset, 0.0, 1.0);
  if (intensity_step > 0.0) reported = intensity_step * std::round(reported / intensity_step);
  return static_cast<float>(std::min(reported, 1.0));
}

std::string LidarFlaws::faults(const SensorModel& sensor) const {
  std::ostringstream out;
  if (!beams.empty() && beams.size() != static_cast<std::size_t>(sensor.rings)) {
    out << "flaws.beams has " << beams.size() << " entries for " << sensor.rings << " rings\n";
  }
  if (!(mixed_share >= 0.0 && mixed_share <= 1.0)) {
    out << "flaws.mixed_share is " << mixed_share << ", must be 0 to 1\n";
  }
  if (!(intensity_gain > 0.0 && intensity_gamma > 0.0 && intensity_step >= 0.0 &&
        intensity_floor >= 0.0)) {
    out << "flaws.intensity_gain and intensity_gamma must be above 0, intensity_step and "
           "intensity_floor 0 or more\n";
  }
  return out.str();
}

LidarFlaws random_flaws(const SensorModel& sensor, Random random) {
  LidarFlaws flaws;
  flaws.beams = random_beams(sensor, random);
  flaws.blind_spots = random_blind_spots(sensor, random);
  flaws.roll = 0.7 * rad_per_deg * random.normal();
  flaws.pitch = 0.7 * rad_per_deg * random.normal();
  // Sensors compress or stretch contrast; a surface of 0.25 is reported as 0.12 to 0.5. A HDL-64E
  // as KITTI has it shows ground and walls nearly alike, and what is dark as 0.
  const bool equalised = random.chance(0.7);
  flaws.intensity_gamma = equalised ? random.uniform(0.12, 0.4) : random.uniform(0.3, 1.2);
  flaws.intensity_gain =
      random.uniform(equalised ? 0.3 : 0.12, 0.5) / std::pow(0.25, flaws.intensity_gamma);
  flaws.intensity_floor = equalised ? random.uniform(0.0, 0.04) : 0.0;
  flaws.intensity_offset = random.uniform(equalised ? -0.05 : -0.1, 0.05);
  flaws.intensity_step = random.chance(0.5) ? 0.01 : 1.0 / 255.0;
  flaws.mixed_share = random.uniform(0.0, 0.4);
  return flaws;
}

std::string BeamNoise::faults() const {
  std::ostringstream out;
  const auto check = [&](double value, double high, const char* field) {
    if (value >= 0.0 && value <= high) return;
    out << "noise." << field << " is " << value << ", must be 0 to " << high << '\n';
  };
  check(range_sigma_m, 1.0, "range_sigma_m");
  check(drop_share, 1.0, "drop_share");
  check(intensity_sigma, 1.0, "intensity_sigma");
  check(min_return, 1.0, "min_return");
  return out.str();
}

std::optional<BeamReturn> beam_return(const BeamNoise& noise, float range_m, float cos_incidence,
                                      const SurfaceProperties& surface, float brightness,
                                      Random& random) {
  if (random.chance(noise.drop_share) || random.chance(surface.lost)) return std::nullopt;
  // Rough surfaces reflect more at grazing angles than Lambert's cosine law: its square root.
  const double angle = std::sqrt(static_cast<double>(cos_incidence));
  const double reflected = surface.reflectivity * brightness * angle;
  const double received = reflected / (static_cast<double>(range_m) * range_m);
  const double weakness = noise.min_return / std::max(received, 1e-12);
  const double faint = weakness * weakness * weakness;
  if (random.uniform() * (1.0 + faint) > 1.0) return std::nullopt;
  // The intensity that the sensor reports is corrected for range, but not fully.
  const double falloff = 1.0 / (1.0 + range_m * range_m / (70.0 * 70.0));
  const double gloss = surface.gloss > 0.0F ? std::pow(cos_incidence, surface.gloss) : 1.0;
  const double intensity =
      0.85 * reflected * falloff * gloss + noise.intensity_sigma * random.normal();
  double range = range_m + noise.range_sigma_m * random.normal();
  if (surface.pile_m > 0.0F) {
    constexpr double deepest_m = 0.5;
    const double way_m = surface.pile_m / std::max(static_cast<double>(cos_incidence), 0.05);
    range -= std::min(way_m, deepest_m) * random.uniform();
  }
  return BeamReturn{static_cast<float>(range), static_cast<float>(std::clamp(intensity, 0.0, 1.0))};
}

}  // namespace stillmap::simulation
