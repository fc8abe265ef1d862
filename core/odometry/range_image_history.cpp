#include "core/odometry/range_image_history.hpp"

#include <cmath>
#include <utility>

namespace stillmap {
namespace {

/// A surface is the same one within this distance along the ray [m].
constexpr float same_surface_m = 0.3F;
/// What stood farther before the point than this was another object [m].
constexpr float max_gone_gap_m = 3.0F;

}  // namespace

float RangeImageHistory::margin(float range_m) const {
  return static_cast<float>(config_.free_margin_m) +
         static_cast<float>(config_.free_margin_share) * range_m;
}

std::size_t RangeImageHistory::size() const {
  return views_.size() / static_cast<std::size_t>(config_.range_image_history_interval);
}

PastObservation RangeImageHistory::observation(std::size_t age, const Eigen::Vector3f& point_map,
                                               const RangeImageView& now) const {
  const auto interval = static_cast<std::size_t>(config_.range_image_history_interval);
  const RangeImageView& past = views_[views_.size() - (age + 1) * interval];
  const auto observation = past.observe(point_map);
  if (!observation) return PastObservation::unknown;
  if (observation->nearest_m > observation->point_range_m + margin(observation->point_range_m))
    return PastObservation::free;
  if (!observation->movable) return PastObservation::unknown;
  if (std::abs(observation->range_m - observation->point_range_m) < same_surface_m)
    return PastObservation::same;
  const float gap = observation->point_range_m - observation->range_m;
  if (gap < margin(observation->range_m) || gap > max_gone_gap_m) return PastObservation::unknown;
  const Eigen::Vector3f surface_map =
      past.origin_map() + observation->range_m * observation->direction_map;
  return sees_through(now, surface_map) ? PastObservation::removed_in_front
                                        : PastObservation::unknown;
}

bool RangeImageHistory::sees_through(const RangeImageView& view,
                                     const Eigen::Vector3f& point_map) const {
  const auto observation = view.observe(point_map);
  return observation &&
         observation->nearest_m > observation->point_range_m + margin(observation->point_range_m);
}

void RangeImageHistory::add(RangeImageView view) {
  views_.push_back(std::move(view));
  const auto kept = static_cast<std::size_t>(config_.range_image_history_size *
                                             config_.range_image_history_interval);
  if (views_.size() > kept) views_.pop_front();
}

}  // namespace stillmap
