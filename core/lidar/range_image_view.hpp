#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// A posed range image: the ranges of a scan over direction, and the pose it was taken from.
class RangeImageView {
 public:
  RangeImageView(const Scan& scan, std::span<const SemanticClass> labels, const SensorModel& sensor,
                 const Eigen::Isometry3d& T_map_lidar);

  /// What was measured in the direction of a point.
  struct Observation {
    float range_m;
    /// Smallest range in the 3 x 3 pixels around.
    float nearest_m;
    bool movable;
    /// From this view's lidar to the point [m].
    float point_range_m;
    Eigen::Vector3f direction_map;
  };
  [[nodiscard]] std::optional<Observation> observe(const Eigen::Vector3f& point_map) const;

  [[nodiscard]] const Eigen::Vector3f& origin_map() const { return origin_map_; }

  /// Replaces the pose.
  void move_to(const Eigen::Isometry3d& T_map_lidar);

 private:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  /// Pixel and range of a measured point.
  struct Return {
    std::uint32_t pixel = 0;
    float range_m = 0.0F;
  };
  void project(std::span<const Eigen::Vector3f> points_lidar, std::span<Return> returns) const;
  /// `none` outside the field of view, or without a range.
  [[nodiscard]] std::uint32_t pixel_at(float row, float column, float range_m) const {
    // Half a row of slack: the outermost beams look along the edge of the field of view.
    const bool is_seen = range_m > 0.0F && row >= -0.5F && row < static_cast<float>(rows_) + 0.5F;
    const int r = std::clamp(static_cast<int>(is_seen ? row : 0.0F), 0, rows_ - 1);
    const int c = std::clamp(static_cast<int>(is_seen ? column : 0.0F), 0, columns_ - 1);
    return is_seen ? static_cast<std::uint32_t>(r * columns_ + c) : none;
  }
  [[nodiscard]] std::uint32_t pixel_of(const Eigen::Vector3f& point_lidar, float range_m) const;

  int rows_;
  int columns_;
  float fov_up_;
  float rows_per_rad_;
  Eigen::Isometry3f T_lidar_map_;
  Eigen::Vector3f origin_map_;
  /// Range [m], negative for surfaces that are not movable; 0 where nothing was measured.
  std::vector<float> pixels_;
};

}  // namespace stillmap
