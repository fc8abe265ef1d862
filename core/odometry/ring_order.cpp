#include "core/odometry/ring_order.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <numeric>

namespace stillmap {

RingOrder::RingOrder(const Scan& scan) : order_(scan.size()) {
  assert(scan.ring.size() == scan.size());
  std::uint16_t last_ring = 0;
  for (const std::uint16_t ring : scan.ring) last_ring = std::max(last_ring, ring);
  const std::size_t rings = scan.empty() ? 0 : std::size_t{last_ring} + 1;
  begin_.assign(rings + 1, 0);
  for (const std::uint16_t ring : scan.ring) ++begin_[ring + 1U];
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  std::vector<std::uint32_t> next(begin_.begin(), begin_.end());
  const std::span<std::uint32_t> order(order_);
  const auto count = static_cast<std::uint32_t>(scan.size());
  for (std::uint32_t i = 0; i < count; ++i) order[next[scan.ring[i]]++] = i;
}

float ray_step_rad(std::span<const Eigen::Vector3f> ring_lidar) {
  constexpr float same_ray_rad = 1e-4F;
  // So many tell.
  constexpr std::size_t enough = 200;
  // Odd: of two returns a ray, every second pair would be of one ray.
  const std::size_t stride = std::max<std::size_t>(1, ring_lidar.size() / enough) | 1U;
  std::vector<float> steps_rad;
  steps_rad.reserve(ring_lidar.size() / stride + 1);
  for (std::size_t i = 1; i < ring_lidar.size(); i += stride) {
    const Eigen::Vector3f& before = ring_lidar[i - 1];
    const Eigen::Vector3f& here = ring_lidar[i];
    const float sine = before.cross(here).norm() / (before.norm() * here.norm());
    if (sine > same_ray_rad) steps_rad.push_back(sine);
  }
  if (steps_rad.empty()) return 0.0F;
  // Where most rays do not return, most steps are gaps.
  const auto low = steps_rad.begin() + static_cast<std::ptrdiff_t>(steps_rad.size() / 10);
  std::ranges::nth_element(steps_rad, low);
  return *low;
}

}  // namespace stillmap
