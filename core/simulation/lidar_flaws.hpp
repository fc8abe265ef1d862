#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/lidar/sensor_model.hpp"
#include "core/simulation/random.hpp"

namespace stillmap::simulation {

/// How one beam differs from its data sheet.
struct BeamFlaw {
  double elevation_error = 0.0;  ///< [rad]
  /// Where the beam leaves the sensor, above the origin of its points [m].
  double height_m = 0.0;
  /// Factor on intensity and on what it can still see.
  double gain = 1.0;
};

/// A part of the view that the vehicle's own roof or rack covers: an ellipse with ragged edges.
struct BlindSpot {
  double azimuth, elevation, half_width, half_height;  ///< [rad]
};

/// How a lidar on a car differs from an ideal one; the default differs in nothing.
struct LidarFlaws {
  /// One a ring, or empty.
  std::vector<BeamFlaw> beams;
  std::vector<BlindSpot> blind_spots;
  /// How the sensor leans on its mount [rad].
  double roll = 0.0, pitch = 0.0;
  /// Reported intensity: gain * intensity^gamma + offset, rounded to steps (0: not rounded).
  double intensity_gain = 1.0, intensity_gamma = 1.0, intensity_offset = 0.0;
  double intensity_step = 0.0;
  /// Share of returns at depth edges that lie between the two surfaces.
  double mixed_share = 0.0;

  [[nodiscard]] BeamFlaw beam(std::size_t ring) const;
  /// True where the vehicle itself is in the way.
  [[nodiscard]] bool is_blind(double azimuth, double elevation, std::size_t ring) const;
  [[nodiscard]] float reported_intensity(float intensity, std::size_t ring) const;
  /// Every fault in words, one a line.
  [[nodiscard]] std::string faults(const SensorModel& sensor) const;
};

/// Flaws such as real sensors have, some of them strong.
[[nodiscard]] LidarFlaws random_flaws(const SensorModel& sensor, Random random);

}  // namespace stillmap::simulation
