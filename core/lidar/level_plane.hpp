#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace stillmap {

/// A plane that is nearly level: z = height_m + slope . (x, y), in the frame of its points.
struct LevelPlane {
  double height_m = 0.0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();

  [[nodiscard]] double at(const Eigen::Vector2d& xy) const { return height_m + slope.dot(xy); }
};

/// The plane that most of the points lie on, by random samples (RANSAC, the same for the
/// same points) and least squares: at least `min_share` of them within 0.2 m, steeper than
/// `max_slope` nowhere. Nothing where there is none.
[[nodiscard]] std::optional<LevelPlane> fit_level_plane(std::span<const Eigen::Vector3f> points,
                                                        double max_slope, double min_share);

}  // namespace stillmap
