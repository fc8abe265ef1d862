#include "core/odometry/ring_tangents.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/odometry/ring_order.hpp"

namespace stillmap {
namespace {

/// The next point on one side of a ring that is so far off that its direction is no noise.
std::optional<Eigen::Vector3f> point_beside(const std::vector<Eigen::Vector3f>& points,
                                            std::span<const std::uint32_t> ring, std::size_t at,
                                            bool is_forwards, std::size_t max_steps) {
  constexpr float min_distance_m = 0.3F;
  const Eigen::Vector3f& here = points[ring[at]];
  for (std::size_t step = 1; step <= max_steps; ++step) {
    if (is_forwards ? at + step >= ring.size() : step > at) break;
    const Eigen::Vector3f& beside = points[ring[is_forwards ? at + step : at - step]];
    if ((beside - here).squaredNorm() >= min_distance_m * min_distance_m) return beside;
  }
  return std::nullopt;
}

Eigen::Vector3f tangent_at(const std::vector<Eigen::Vector3f>& points,
                           std::span<const std::uint32_t> ring, std::size_t at,
                           std::size_t max_steps) {
  constexpr float min_cosine = 0.95F;
  /// Of the angle between the rays: beyond it points were left out.
  constexpr float max_sine = 0.1F;
  const auto before = point_beside(points, ring, at, /*is_forwards=*/false, max_steps);
  const auto after = point_beside(points, ring, at, /*is_forwards=*/true, max_steps);
  if (!before || !after) return Eigen::Vector3f::Zero();
  const Eigen::Vector3f to_here = points[ring[at]] - *before;
  const Eigen::Vector3f from_here = *after - points[ring[at]];
  const bool is_straight = to_here.dot(from_here) > min_cosine * to_here.norm() * from_here.norm();
  const bool is_whole = before->cross(*after).norm() < max_sine * before->norm() * after->norm();
  return is_straight && is_whole ? (to_here + from_here).normalized() : Eigen::Vector3f::Zero();
}

}  // namespace

std::vector<Eigen::Vector3f> ring_tangents(const Scan& scan, std::span<const std::uint32_t> chosen,
                                           std::size_t max_steps) {
  std::vector<Eigen::Vector3f> tangents(scan.size(), Eigen::Vector3f::Zero());
  std::vector<std::uint8_t> is_chosen(scan.size());
  for (const std::uint32_t i : chosen) is_chosen[i] = 1;
  const RingOrder rings(scan);
  tbb::parallel_for(std::size_t{0}, rings.count(), [&](std::size_t r) {
    const auto ring = rings.ring(r);
    for (std::size_t at = 0; at < ring.size(); ++at)
      if (is_chosen[ring[at]] != 0)
        tangents[ring[at]] = tangent_at(scan.points_lidar, ring, at, max_steps);
  });
  return tangents;
}

}  // namespace stillmap
