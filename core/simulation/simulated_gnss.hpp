#pragma once

#include <vector>

#include "core/geodesy/gnss_fix.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap::simulation {

/// A receiver of single frequency in a town; 0.02 m of wander and noise is one with corrections
/// (RTK).
struct GnssErrors {
  double rate_hz = 5.0;
  /// Of the error that stays for a minute, east and north; twice that up [m]. What a fix says of
  /// itself is this.
  double wander_m = 1.5;
  double wander_time_s = 60.0;
  /// Of one fix, for each metre of wander.
  double noise_share = 0.3;
  /// Signals that came by way of a house: so many stretches an hour, so long, off by so many
  /// times the wander. The fix does not know of it.
  double reflections_an_hour = 40.0;
  double reflection_s = 6.0;
  double reflection_factor = 8.0;
  /// Of the stamps: so much later than the lidar was there [s].
  double delay_s = 0.0;
};

/// Where every city lies: its origin, x east.
inline constexpr double city_latitude_deg = 49.0;
inline constexpr double city_longitude_deg = 8.4;
inline constexpr double city_altitude_m = 115.0;

/// What a receiver says whose antenna is at the lidar of a simulation. The same configuration gives
/// the same fixes.
[[nodiscard]] std::vector<GnssFix> simulated_gnss(const Simulation& simulation,
                                                  const GnssErrors& errors = {});

}  // namespace stillmap::simulation
