#pragma once

#include <cstdint>
#include <deque>

#include "core/lidar/range_image_view.hpp"
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
