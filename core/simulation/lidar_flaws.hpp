#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/lidar/sensor_model.hpp"
#include "core/simulation/materials.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// Noise of range and intensity, and lost returns.
struct BeamNoise {
  double range_sigma_m = 0.02;
  /// Share of beams lost at random.
  double drop_share = 0.01;
  double intensity_sigma = 0.015;
  /// reflectivity * sqrt(cos incidence) / range^2 at which half of the beams come back [1/m^2].
  double min_return = 1.2e-5;

  /// All faults, one a line.
  [[nodiscard]] std::string faults() const;
};

struct BeamReturn {
  float range_m;
  /// 0..1.
  float intensity;
};

/// The measurement of a surface `range_m` away; none when too little light comes back.
/// @param brightness factor on the surface's reflectivity.
[[nodiscard]] std::optional<BeamReturn> beam_return(const BeamNoise& noise, float range_m,
                                                    float cos_incidence,
                                                    const SurfaceProperties& surface,
                                                    float brightness, Random& random);

/// Deviations of one beam from its data sheet.
struct BeamFlaw {
  double elevation_error = 0.0;  ///< [rad]
  /// Origin of the beam, above the origin of the lidar frame [m].
  double height_m = 0.0;
  /// Factor on intensity and on sensitivity.
  double gain = 1.0;
};

/// A part of the view that the vehicle itself covers: an ellipse with ragged edges.
struct BlindSpot {
  double azimuth, elevation, half_width, half_height;  ///< [rad]
};

/// Deviations of a mounted lidar from an ideal one; none by default.
struct LidarFlaws {
  /// One for each ring, or empty.
  std::vector<BeamFlaw> beams;
  std::vector<BlindSpot> blind_spots;
  /// Misalignment of the mount [rad].
  double roll = 0.0, pitch = 0.0;
  /// Reported intensity: gain * intensity^gamma + offset, rounded to steps (0: not rounded).
  double intensity_gain = 1.0, intensity_gamma = 1.0, intensity_offset = 0.0;
  double intensity_step = 0.0;
  /// Intensity below which 0 is reported.
  double intensity_floor = 0.0;
  /// Share of returns at depth edges that lie between the two surfaces.
  double mixed_share = 0.0;

  [[nodiscard]] BeamFlaw beam(std::size_t ring) const;
  /// True inside a blind spot.
  [[nodiscard]] bool is_blind(double azimuth, double elevation, std::size_t ring) const;
  [[nodiscard]] float reported_intensity(float intensity, std::size_t ring) const;
  /// All faults, one a line.
  [[nodiscard]] std::string faults(const SensorModel& sensor) const;
};

/// Random flaws of the size that real sensors have, some of them strong.
[[nodiscard]] LidarFlaws random_flaws(const SensorModel& sensor, Random random);

}  // namespace stillmap::simulation
