#include "core/lidar/range_image_view.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace stillmap {
namespace {

/// Finer columns would leave pixels empty between the shots of a turning lidar.
constexpr int max_columns = 1024;

/// So many points are projected at once, in vector registers.
constexpr Eigen::Index batch_size = 256;
using Batch = Eigen::Array<float, batch_size, 1>;

constexpr float pi = std::numbers::pi_v<float>;

/// Arc tangent of `t`, |t| <= 1, to 1e-5 rad: a five hundredth of a pixel.
template <class T>
T small_arc_tangent(const T& t) {
  const T s = t * t;
  return t * (0.99997726F +
              s * (-0.33262347F +
                   s * (0.19354346F + s * (-0.11643287F + s * (0.05265332F + s * -0.01172120F)))));
}

float fast_atan2(float y, float x) {
  // Without branches: the octant of the next point is anybody's guess.
  const float width = std::abs(x);
  const float height = std::abs(y);
  const float larger = std::max(width, height);
  const float within_octant =
      small_arc_tangent(std::min(width, height) / (larger > 0.0F ? larger : 1.0F));
  const float within_quadrant = height > width ? 0.5F * pi - within_octant : within_octant;
  return std::copysign(x < 0.0F ? pi - within_quadrant : within_quadrant, y);
}

/// The same for many, not both of them 0.
Batch fast_atan2(const Batch& y, const Batch& x) {
  const Batch larger = x.abs().max(y.abs());
  const Batch smaller = x.abs().min(y.abs());
  Batch angle = small_arc_tangent<Batch>(smaller / larger);
  angle = (y.abs() > x.abs()).select(0.5F * pi - angle, angle);
  angle = (x < 0.0F).select(pi - angle, angle);
  return (y < 0.0F).select(-angle, angle);
}

}  // namespace

RangeImageView::RangeImageView(const Scan& scan, std::span<const SemanticClass> labels,
                               const SensorModel& sensor, const Eigen::Isometry3d& T_map_lidar)
    : rows_(sensor.rings),
      columns_(std::min(sensor.columns, max_columns)),
      fov_up_(static_cast<float>(sensor.fov_up)),
      rows_per_rad_(static_cast<float>(sensor.rings / (sensor.fov_up - sensor.fov_down))),
      pixels_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_), 0.0F) {
  move_to(T_map_lidar);
  std::vector<Return> returns(scan.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 4096), [&](const auto& block) {
    constexpr auto step = static_cast<std::size_t>(batch_size);
    for (std::size_t i = block.begin(); i < block.end(); i += step) {
      const std::size_t count = std::min(step, block.end() - i);
      project(std::span(scan.points_lidar).subspan(i, count), std::span(returns).subspan(i, count));
    }
  });
  for (std::size_t i = 0; i < returns.size(); ++i) {
    const auto [pixel, range_m] = returns[i];
    if (pixel == none) continue;
    // Without branches: which of two returns comes first is anybody's guess.
    const float old = pixels_[pixel];
    const bool is_nearer = old == 0.0F || range_m < std::abs(old);
    const float signed_range = !labels.empty() && is_movable(labels[i]) ? range_m : -range_m;
    pixels_[pixel] = is_nearer ? signed_range : old;
  }
}

void RangeImageView::move_to(const Eigen::Isometry3d& T_map_lidar) {
  T_lidar_map_ = T_map_lidar.inverse().cast<float>();
  origin_map_ = T_map_lidar.translation().cast<float>();
}

void RangeImageView::project(std::span<const Eigen::Vector3f> points_lidar,
                             std::span<Return> returns) const {
  Batch x = Batch::Ones(), y = Batch::Ones(), z = Batch::Ones();
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    x[k] = points_lidar[i].x();
    y[k] = points_lidar[i].y();
    z[k] = points_lidar[i].z();
  }
  const Batch across = (x.square() + y.square()).sqrt();
  const Batch range_m = (across.square() + z.square()).sqrt();
  const Batch row = (fov_up_ - fast_atan2(z, across)) * rows_per_rad_;
  const Batch column = 0.5F * (1.0F - fast_atan2(y, x) / pi) * static_cast<float>(columns_);
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    returns[i] = {pixel_at(row[k], column[k], range_m[k]), range_m[k]};
  }
}

std::uint32_t RangeImageView::pixel_of(const Eigen::Vector3f& point_lidar, float range_m) const {
  const float elevation = fast_atan2(point_lidar.z(), point_lidar.head<2>().norm());
  const float turn = 0.5F * (1.0F - fast_atan2(point_lidar.y(), point_lidar.x()) / pi);
  return pixel_at((fov_up_ - elevation) * rows_per_rad_, turn * static_cast<float>(columns_),
                  range_m);
}

std::optional<RangeImageView::Observation> RangeImageView::observe(
    const Eigen::Vector3f& point_map) const {
  const Eigen::Vector3f point_lidar = T_lidar_map_ * point_map;
  Observation observation{};
  observation.point_range_m = point_lidar.norm();
  const std::uint32_t pixel = pixel_of(point_lidar, observation.point_range_m);
  if (pixel == none || pixels_[pixel] == 0.0F) return std::nullopt;
  observation.range_m = std::abs(pixels_[pixel]);
  observation.movable = pixels_[pixel] > 0.0F;
  observation.nearest_m = observation.range_m;
  observation.direction_map = (point_map - origin_map_) / observation.point_range_m;
  const int row = static_cast<int>(pixel) / columns_;
  const int column = static_cast<int>(pixel) - row * columns_;
  // The image is closed at the rear.
  const int left = column == 0 ? columns_ - 1 : column - 1;
  const int right = column + 1 == columns_ ? 0 : column + 1;
  for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
    for (const int c : {left, column, right}) {
      const float range = std::abs(pixels_[static_cast<std::size_t>(r * columns_ + c)]);
      if (range > 0.0F) observation.nearest_m = std::min(observation.nearest_m, range);
    }
  }
  return observation;
}

}  // namespace stillmap
