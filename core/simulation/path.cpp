#include "core/simulation/path.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace stillmap::simulation {
namespace {

using Eigen::Vector2d;

constexpr double step_m = 0.25;

Vector2d right_of(const Vector2d& along) { return {along.y(), -along.x()}; }

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Points every `step_m` of the map along the closed polygon.
std::vector<Vector2d> resample(const GroundShape& ground, const std::vector<Vector2d>& corners) {
  std::vector<Vector2d> fine;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector2d way = corners[(i + 1) % corners.size()] - corners[i];
    const int pieces = std::max(1, static_cast<int>(std::ceil(way.norm() / 0.1)));
    for (int k = 0; k < pieces; ++k) fine.push_back(corners[i] + way * k / pieces);
  }
  std::vector<double> arc{0.0};
  for (std::size_t i = 0; i < fine.size(); ++i) {
    const Vector2d& next = fine[(i + 1) % fine.size()];
    arc.push_back(arc.back() + (ground.to_map(next) - ground.to_map(fine[i])).norm());
  }
  const auto count = static_cast<std::size_t>(std::lround(arc.back() / step_m));
  std::vector<Vector2d> out;
  std::size_t at = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double wanted = arc.back() * static_cast<double>(i) / static_cast<double>(count);
    while (arc[at + 1] <= wanted) ++at;
    const double part = (wanted - arc[at]) / (arc[at + 1] - arc[at]);
    out.push_back(fine[at] + part * (fine[(at + 1) % fine.size()] - fine[at]));
  }
  return out;
}

}  // namespace

Path::Path(const GroundShape& ground, const std::vector<Vector2d>& corners_plan) {
  const std::vector<Vector2d> points = resample(ground, corners_plan);
  const std::size_t n = points.size();
  const auto map = [&](std::size_t i) { return ground.to_map(points[i % n]); };
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2d before = map(i) - map(i + n - 4);
    const Vector2d after = map(i + 4) - map(i);
    const double angle = std::abs(std::atan2(cross(before, after), before.dot(after)));
    const double arc = 0.5 * (before.norm() + after.norm());
    length_m_ += (map(i + 1) - map(i)).norm();
    samples_.push_back(
        {points[i], (points[(i + 1) % n] - points[(i + n - 1) % n]).normalized(), angle / arc});
  }
}

double Path::wrapped(double position_m) const {
  const double rest = std::fmod(position_m, length_m_);
  return rest < 0.0 ? rest + length_m_ : rest;
}

Path::Spot Path::at(double position_m) const {
  const std::size_t n = samples_.size();
  const double index = wrapped(position_m) / length_m_ * static_cast<double>(n);
  const auto low = std::min(static_cast<std::size_t>(index), n - 1);
  const double part = index - static_cast<double>(low);
  const Sample& a = samples_[low];
  const Sample& b = samples_[(low + 1) % n];
  const Vector2d along = (1.0 - part) * a.along_plan + part * b.along_plan;
  return {(1.0 - part) * a.plan + part * b.plan, std::atan2(along.y(), along.x())};
}

double Path::curvature(double position_m) const {
  const double index = wrapped(position_m) / length_m_ * static_cast<double>(samples_.size());
  return samples_[std::min(static_cast<std::size_t>(index), samples_.size() - 1)].curvature;
}

double Path::nearest(const Vector2d& spot_plan) const {
  const auto best = std::ranges::min_element(
      samples_, {}, [&](const Sample& sample) { return (sample.plan - spot_plan).squaredNorm(); });
  return length_m_ * static_cast<double>(best - samples_.begin()) /
         static_cast<double>(samples_.size());
}

Path route_path(const GroundShape& ground, bool reversed, double offset_m,
                std::optional<double> turn_radius_m) {
  std::vector<Vector2d> corners = ground.plan().route;
  if (reversed) std::ranges::reverse(corners);
  const std::size_t n = corners.size();
  std::vector<Vector2d> points;
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2d in = (corners[i] - corners[(i + n - 1) % n]).normalized();
    const Vector2d out = (corners[(i + 1) % n] - corners[i]).normalized();
    const Vector2d corner = corners[i] + offset_m * (right_of(in) + right_of(out));
    const double to_left = cross(in, out);
    const double radius = turn_radius_m.value_or(ground.plan().turn_radius_m + to_left * offset_m);
    const Vector2d centre = corner - radius * in + radius * out;
    constexpr int pieces = 24;
    for (int k = 0; k <= pieces; ++k) {
      const double turn = 0.5 * std::numbers::pi * k / pieces;
      points.push_back(centre + radius * (std::sin(turn) * in - std::cos(turn) * out));
    }
  }
  return {ground, points};
}

}  // namespace stillmap::simulation
