#pragma once

#include <cstdint>
#include <deque>

#include "core/lidar/range_image_view.hpp"
#include "core/odometry/odometry_config.hpp"

namespace stillmap {

/// What an earlier scan saw at the place of a point.
enum class PastObservation : std::uint8_t {
  /// Nothing can be said: hidden, outside the field of view, no return.
  unknown,
  /// A surface was there.
  same,
  /// The ray went on behind it: nothing was there.
  free,
  /// A movable surface stood just before it, where the newest scan now sees through.
  removed_in_front,
};

/// The last few scans, kept to ask of a point whether its place was free or filled before.
class RangeImageHistory {
 public:
  explicit RangeImageHistory(const MotionConfig& config) : config_(config) {}

  /// What the `age`-th kept view saw at a point of the newest scan, 0 the youngest. `now` is the
  /// view of the newest scan, which is not kept yet.
  [[nodiscard]] PastObservation observation(std::size_t age, const Eigen::Vector3f& point_map,
                                            const RangeImageView& now) const;

  /// Whether `view` looks through this place to something behind it.
  [[nodiscard]] bool sees_through(const RangeImageView& view,
                                  const Eigen::Vector3f& point_map) const;

  void add(RangeImageView view);
  void clear() { views_.clear(); }
  /// Views that can be asked, at most `config.range_image_history_size`.
  [[nodiscard]] std::size_t size() const;

 private:
  [[nodiscard]] float margin(float range_m) const;

  MotionConfig config_;
  /// Every scan since the oldest view that can be asked, newest last.
  std::deque<RangeImageView> views_;
};

}  // namespace stillmap
