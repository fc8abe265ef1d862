#include "core/elevation_calibration.hpp"

#include <tsl/robin_set.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "core/lidar/voxel_index.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap {
namespace {

/// Voxels that a drive occupies.
class OccupiedVoxels {
 public:
  explicit OccupiedVoxels(const ElevationCalibrationConfig& config)
      : per_m_(1.0 / config.voxel_size_m), max_range_m_(static_cast<float>(config.max_range_m)) {}

  void add(const Scan& scan, const Eigen::Isometry3d& T_map_lidar) {
    for (const Eigen::Vector3f& point : scan.points_lidar) {
      if (point.squaredNorm() > max_range_m_ * max_range_m_) continue;
      const Eigen::Vector3d place = per_m_ * (T_map_lidar * point.cast<double>());
      const auto index = [&](int axis) {
        return static_cast<std::int64_t>(std::floor(place[axis]));
      };
      voxels_.insert(packed_index(index(0), index(1), index(2)));
    }
  }
  [[nodiscard]] std::size_t count() const { return voxels_.size(); }

 private:
  double per_m_;
  float max_range_m_;
  tsl::robin_set<std::uint64_t, IndexHash> voxels_;
};

std::size_t voxels_with(MapperConfig config, double offset, std::size_t scans,
                        const std::function<Scan(std::size_t)>& scan_at,
                        const ElevationCalibrationConfig& calibration) {
  config.sensor.elevation_offset = offset;
  Mapper mapper(config, std::make_unique<NullSegmenter>());
  OccupiedVoxels voxels(calibration);
  for (std::size_t k = 0; k < scans; ++k) {
    const auto mapped = mapper.process(scan_at(k));
    if (mapped && mapped->odometry.is_confirmed())
      voxels.add(mapped->labelled.scan, mapped->odometry.T_map_lidar);
  }
  return voxels.count();
}

/// A parabola through the trials, by least squares.
struct Parabola {
  /// Its lowest point and the standard deviation of that [rad].
  double lowest_at = 0.0;
  double sigma = 0.0;
  bool has_lowest = false;
  /// Its value there, and at 0.
  double lowest = 0.0;
  double at_zero = 0.0;
};

Parabola fit_parabola(std::span<const ElevationCalibration::Trial> trials) {
  // In units of the largest offset, so that the normal matrix is well conditioned.
  const double unit = trials.back().offset;
  const auto n = static_cast<Eigen::Index>(trials.size());
  Eigen::MatrixX3d design(n, 3);
  Eigen::VectorXd voxels(n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto& trial = trials[static_cast<std::size_t>(k)];
    const double x = trial.offset / unit;
    design.row(k) << 1.0, x, x * x;
    voxels[k] = static_cast<double>(trial.voxels);
  }
  const Eigen::Matrix3d inverse = (design.transpose() * design).inverse();
  const Eigen::Vector3d c = inverse * (design.transpose() * voxels);
  Parabola parabola{.at_zero = c[0]};
  if (!(c[2] > 0.0) || n <= 3) return parabola;
  const double variance = (voxels - design * c).squaredNorm() / static_cast<double>(n - 3);
  const double x = -0.5 * c[1] / c[2];
  const Eigen::Vector3d gradient(0.0, -0.5 / c[2], 0.5 * c[1] / (c[2] * c[2]));
  parabola.lowest_at = unit * x;
  parabola.sigma = unit * std::sqrt(variance * gradient.dot(inverse * gradient));
  parabola.has_lowest = std::abs(x) < 1.0;
  parabola.lowest = c[0] + 0.5 * c[1] * x;
  return parabola;
}

}  // namespace

ElevationCalibration calibrate_elevation(const MapperConfig& mapper, std::size_t scans,
                                         const std::function<Scan(std::size_t)>& scan_at,
                                         const ElevationCalibrationConfig& config) {
  ElevationCalibration found;
  const auto none_at = static_cast<std::ptrdiff_t>(config.trials() / 2);
  for (std::ptrdiff_t k = -none_at; k <= none_at; ++k) {
    const double offset = static_cast<double>(k) * config.step;
    found.trials.push_back({offset, voxels_with(mapper, offset, scans, scan_at, config)});
  }
  const Parabola parabola = fit_parabola(found.trials);
  if (!parabola.has_lowest || parabola.sigma > config.max_sigma) return found;
  found.offset = parabola.lowest_at;
  found.sigma = parabola.sigma;
  found.saving = 1.0 - parabola.lowest / parabola.at_zero;
  return found;
}

}  // namespace stillmap
