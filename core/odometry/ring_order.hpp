#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// The points of a scan by ring, as indices into the scan, in firing order.
class RingOrder {
 public:
  /// `scan.ring` must be known.
  explicit RingOrder(const Scan& scan);

  /// Rings up to the last one that has points.
  [[nodiscard]] std::size_t count() const { return begin_.size() - 1; }
  [[nodiscard]] std::span<std::uint32_t> ring(std::size_t r) {
    return std::span(order_).subspan(begin_[r], begin_[r + 1] - begin_[r]);
  }
  [[nodiscard]] std::span<const std::uint32_t> ring(std::size_t r) const {
    return std::span(order_).subspan(begin_[r], begin_[r + 1] - begin_[r]);
  }

 private:
  std::vector<std::uint32_t> order_;
  /// Ring r is order_[begin_[r] .. begin_[r + 1]).
  std::vector<std::uint32_t> begin_;
};

/// Angle between neighbouring rays of a ring, whose points are in firing order [rad]: a tenth
/// of them are nearer, since some do not return, or return twice. 0 of fewer than two points.
[[nodiscard]] float ray_step_rad(std::span<const Eigen::Vector3f> ring_lidar);

}  // namespace stillmap
