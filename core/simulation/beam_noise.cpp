#include "core/simulation/beam_noise.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace stillmap::simulation {

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
  // Rough surfaces send more back at grazing angles than Lambert's cosine has it.
  const double angle = std::sqrt(static_cast<double>(cos_incidence));
  const double reflected = surface.reflectivity * brightness * angle;
  const double received = reflected / (static_cast<double>(range_m) * range_m);
  const double weakness = noise.min_return / std::max(received, 1e-12);
  const double faint = weakness * weakness * weakness;
  if (random.uniform() * (1.0 + faint) > 1.0) return std::nullopt;
  // The sensor corrects its intensity for range, not perfectly.
  const double falloff = 1.0 / (1.0 + range_m * range_m / (70.0 * 70.0));
  const double intensity = 0.85 * reflected * falloff + noise.intensity_sigma * random.normal();
  double range = range_m + noise.range_sigma_m * random.normal();
  if (surface.pile_m > 0.0F) {
    constexpr double deepest_m = 0.5;
    const double way_m = surface.pile_m / std::max(static_cast<double>(cos_incidence), 0.05);
    range -= std::min(way_m, deepest_m) * random.uniform();
  }
  return BeamReturn{static_cast<float>(range), static_cast<float>(std::clamp(intensity, 0.0, 1.0))};
}

}  // namespace stillmap::simulation
