#include "core/lidar/level_plane.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <random>

namespace stillmap {
namespace {

constexpr double inlier_distance_m = 0.2;
constexpr std::size_t min_fitted_points = 12;
constexpr int samples = 60;
constexpr int refinements = 3;

bool is_on(const LevelPlane& plane, const Eigen::Vector3f& p) {
  const Eigen::Vector3d q = p.cast<double>();
  return std::abs(q.z() - plane.at(q.head<2>())) < inlier_distance_m;
}

std::size_t count_on(const LevelPlane& plane, std::span<const Eigen::Vector3f> points) {
  return static_cast<std::size_t>(
      std::ranges::count_if(points, [&](const Eigen::Vector3f& p) { return is_on(plane, p); }));
}

std::optional<LevelPlane> plane_through(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                        const Eigen::Vector3d& c) {
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  if (std::abs(normal.z()) < 1e-3 * normal.norm() || normal.norm() < 1e-3) return std::nullopt;
  const Eigen::Vector2d slope = -normal.head<2>() / normal.z();
  return LevelPlane{a.z() - slope.dot(a.head<2>()), slope};
}

LevelPlane least_squares(const LevelPlane& start, std::span<const Eigen::Vector3f> points) {
  Eigen::Matrix3d information = 1e-6 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : points) {
    if (!is_on(start, p)) continue;
    const Eigen::Vector3d row(1.0, p.x(), p.y());
    information += row * row.transpose();
    sum += static_cast<double>(p.z()) * row;
  }
  const Eigen::Vector3d solution = information.ldlt().solve(sum);
  return {solution.x(), solution.tail<2>()};
}

}  // namespace

std::optional<LevelPlane> fit_level_plane(std::span<const Eigen::Vector3f> points, double max_slope,
                                          double min_share) {
  if (points.size() < min_fitted_points) return std::nullopt;
  std::mt19937 random(1);
  const auto draw = [&] { return points[random() % points.size()].cast<double>().eval(); };
  std::optional<LevelPlane> best;
  std::size_t most = 0;
  for (int k = 0; k < samples; ++k) {
    const auto plane = plane_through(draw(), draw(), draw());
    if (!plane || plane->slope.norm() > max_slope) continue;
    const std::size_t count = count_on(*plane, points);
    if (count <= most) continue;
    most = count;
    best = plane;
  }
  if (!best) return std::nullopt;
  for (int k = 0; k < refinements; ++k) best = least_squares(*best, points);
  const auto enough = static_cast<double>(points.size()) * min_share;
  if (static_cast<double>(count_on(*best, points)) < enough || best->slope.norm() > max_slope)
    return std::nullopt;
  return best;
}

}  // namespace stillmap
