#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "core/lidar/scan.hpp"

namespace stillmap::test {

inline constexpr double per_degree = std::numbers::pi / 180.0;

/// How uneven the beams of KITTI's lidar are, roughly [deg].
inline constexpr std::array<double, 64> uneven_deg{
    0.11,  0.07,  0.14,  0.01,  0.06,  -0.02, 0.05,  0.0,   -0.01, -0.09, -0.04, -0.05, -0.09,
    -0.08, -0.07, -0.08, -0.04, -0.08, -0.02, -0.05, -0.02, -0.02, -0.01, 0.0,   -0.03, -0.01,
    0.02,  0.08,  0.04,  0.02,  0.12,  0.09,  -0.1,  -0.12, -0.09, 0.02,  0.05,  -0.06, -0.06,
    0.01,  0.05,  0.12,  0.09,  0.06,  -0.02, 0.04,  0.04,  0.16,  0.04,  0.01,  -0.06, -0.02,
    -0.03, 0.05,  0.1,   0.04,  0.03,  -0.1,  -0.07, 0.0,   0.06,  -0.08, -0.06, -0.08};

struct Drawing {
  bool is_uneven = true;
  /// Deviation of a beam's azimuth from the even step [deg].
  double azimuth_noise_deg = 0.07;
  /// Straight ahead during the sweep; the points are compensated for it [m].
  double way_m = 0.0;
};

/// Posts before a wall all round, seen by KITTI's lidar and stored ring after ring as KITTI stores
/// them.
inline Scan draw(const Drawing& drawing, unsigned seed = 1) {
  std::mt19937 random(seed);
  // Its deviation must not be 0.
  std::normal_distribution<double> noise(0.0, 1.0);
  Scan scan;
  for (int ring = 0; ring < 64; ++ring) {
    const double beam_deg = ring < 32 ? 2.0 - ring / 3.0 : -8.83 - (ring - 32) / 2.0;
    const double offset_deg =
        drawing.is_uneven ? uneven_deg.at(static_cast<std::size_t>(ring)) : 0.0;
    const double elevation = (beam_deg + offset_deg) * per_degree;
    for (int column = 0; column < 2000; ++column) {
      const double azimuth = column * 0.18 * per_degree;
      const bool is_post = column / 20 % 4 == 0;
      const bool is_edge = column % 20 == 0;
      const double range_m = is_post ? 6.0 : 20.0;
      const double a =
          azimuth + (is_edge ? drawing.azimuth_noise_deg * per_degree * noise(random) : 0.0);
      Eigen::Vector3d p(range_m * std::cos(a), range_m * std::sin(a),
                        range_m * std::tan(elevation));
      // Measured at -az / 2 pi of the sweep.
      const double turns = std::remainder(a, 2.0 * std::numbers::pi) / (2.0 * std::numbers::pi);
      p.x() -= turns * drawing.way_m;
      scan.points_lidar.push_back(p.cast<float>());
      scan.intensity.push_back(0.5F);
    }
  }
  return scan;
}

}  // namespace stillmap::test
