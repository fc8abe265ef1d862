#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/odometry/odometry_config.hpp"

namespace stillmap {

/// What an earlier scan saw at the place of a point.
enum class PastSight : std::uint8_t {
  /// Nothing can be said: hidden, outside the field of view, no return.
  unknown,
  /// A surface was there.
  same,
  /// The ray went on behind it: nothing was there.
  free,
  /// A movable surface stood just before it, where the newest scan now sees through.
  gone_before_it,
};

/// A scan as ranges over direction, with the pose it was taken from.
class RangeView {
 public:
  RangeView(const Scan& scan, std::span<const SemanticClass> labels, const SensorModel& sensor,
            const Eigen::Isometry3d& T_map_lidar);

  /// What the view saw in the direction of a point.
  struct Sight {
    float range_m;
    /// Smallest range in the 3 x 3 pixels around.
    float nearest_m;
    bool movable;
    /// From this view's lidar to the point [m].
    float point_range_m;
    Eigen::Vector3f direction_map;
  };
  [[nodiscard]] std::optional<Sight> look_at(const Eigen::Vector3f& point_map) const;

  [[nodiscard]] const Eigen::Vector3f& origin_map() const { return origin_map_; }

  /// The scan was taken from here.
  void move_to(const Eigen::Isometry3d& T_map_lidar);

 private:
  [[nodiscard]] std::optional<std::size_t> pixel_of(const Eigen::Vector3f& point_lidar,
                                                    float range_m) const;

  int rows_;
  int columns_;
  float fov_up_;
  float rows_per_rad_;
  Eigen::Isometry3f T_lidar_map_;
  Eigen::Vector3f origin_map_;
  /// Range [m], negative for surfaces that are not movable; 0 where nothing was measured.
  std::vector<float> pixels_;
};

/// The last few scans, kept to ask of a point whether its place was free or filled before.
class PastViews {
 public:
  explicit PastViews(const MotionConfig& config) : config_(config) {}

  /// What the `age`-th kept view saw at a point of the newest scan, 0 the youngest. `now` is the
  /// view of the newest scan, which is not kept yet.
  [[nodiscard]] PastSight sight(std::size_t age, const Eigen::Vector3f& point_map,
                                const RangeView& now) const;

  /// Whether `view` looks through this place to something behind it.
  [[nodiscard]] bool sees_through(const RangeView& view, const Eigen::Vector3f& point_map) const;

  void add(RangeView view);
  void clear() { views_.clear(); }
  /// Views that can be asked, at most `config.past_views`.
  [[nodiscard]] std::size_t size() const;

 private:
  [[nodiscard]] float margin(float range_m) const;

  MotionConfig config_;
  /// Every scan since the oldest view that can be asked, newest last.
  std::deque<RangeView> views_;
};

}  // namespace stillmap
