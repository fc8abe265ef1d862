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
constexpr std::size_t none = std::numeric_limits<std::size_t>::max();

}  // namespace

RangeImageView::RangeImageView(const Scan& scan, std::span<const SemanticClass> labels,
                               const SensorModel& sensor, const Eigen::Isometry3d& T_map_lidar)
    : rows_(sensor.rings),
      columns_(std::min(sensor.columns, max_columns)),
      fov_up_(static_cast<float>(sensor.fov_up)),
      rows_per_rad_(static_cast<float>(sensor.rings / (sensor.fov_up - sensor.fov_down))),
      pixels_(static_cast<std::size_t>(rows_) * static_cast<std::size_t>(columns_), 0.0F) {
  move_to(T_map_lidar);
  struct Return {
    std::size_t pixel = none;
    float range_m = 0.0F;
  };
  std::vector<Return> returns(scan.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 4096), [&](const auto& block) {
    for (std::size_t i = block.begin(); i != block.end(); ++i) {
      const float range_m = scan.points_lidar[i].norm();
      returns[i] = {pixel_of(scan.points_lidar[i], range_m).value_or(none), range_m};
    }
  });
  for (std::size_t i = 0; i < returns.size(); ++i) {
    const auto [pixel, range_m] = returns[i];
    if (pixel == none) continue;
    float& old = pixels_[pixel];
    if (old != 0.0F && std::abs(old) <= range_m) continue;
    old = !labels.empty() && is_movable(labels[i]) ? range_m : -range_m;
  }
}

void RangeImageView::move_to(const Eigen::Isometry3d& T_map_lidar) {
  T_lidar_map_ = T_map_lidar.inverse().cast<float>();
  origin_map_ = T_map_lidar.translation().cast<float>();
}

std::optional<std::size_t> RangeImageView::pixel_of(const Eigen::Vector3f& point_lidar,
                                                    float range_m) const {
  if (range_m <= 0.0F) return std::nullopt;
  const float elevation = std::asin(std::clamp(point_lidar.z() / range_m, -1.0F, 1.0F));
  const float row = (fov_up_ - elevation) * rows_per_rad_;
  // Half a row of slack: the outermost beams look along the edge of the field of view.
  if (row < -0.5F || row >= static_cast<float>(rows_) + 0.5F) return std::nullopt;
  const float turn =
      0.5F * (1.0F - std::atan2(point_lidar.y(), point_lidar.x()) * std::numbers::inv_pi_v<float>);
  const int r = std::clamp(static_cast<int>(row), 0, rows_ - 1);
  const int c = std::clamp(static_cast<int>(turn * static_cast<float>(columns_)), 0, columns_ - 1);
  return static_cast<std::size_t>(r) * static_cast<std::size_t>(columns_) +
         static_cast<std::size_t>(c);
}

std::optional<RangeImageView::Observation> RangeImageView::observe(
    const Eigen::Vector3f& point_map) const {
  const Eigen::Vector3f point_lidar = T_lidar_map_ * point_map;
  Observation observation{};
  observation.point_range_m = point_lidar.norm();
  const auto pixel = pixel_of(point_lidar, observation.point_range_m);
  if (!pixel || pixels_[*pixel] == 0.0F) return std::nullopt;
  observation.range_m = std::abs(pixels_[*pixel]);
  observation.movable = pixels_[*pixel] > 0.0F;
  observation.nearest_m = observation.range_m;
  observation.direction_map = (point_map - origin_map_) / observation.point_range_m;
  const int row = static_cast<int>(*pixel) / columns_;
  const int column = static_cast<int>(*pixel) % columns_;
  for (int r = std::max(0, row - 1); r <= std::min(rows_ - 1, row + 1); ++r) {
    for (int step = -1; step <= 1; ++step) {
      const int c = (column + step + columns_) % columns_;
      const float range = std::abs(pixels_[static_cast<std::size_t>(r * columns_ + c)]);
      if (range > 0.0F) observation.nearest_m = std::min(observation.nearest_m, range);
    }
  }
  return observation;
}

}  // namespace stillmap
