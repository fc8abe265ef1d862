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

float PastViews::margin(float range_m) const {
  return static_cast<float>(config_.free_margin_m) +
         static_cast<float>(config_.free_margin_share) * range_m;
}

std::size_t PastViews::size() const {
  return views_.size() / static_cast<std::size_t>(config_.past_view_interval);
}

PastSight PastViews::sight(std::size_t age, const Eigen::Vector3f& point_map,
                           const RangeView& now) const {
  const auto interval = static_cast<std::size_t>(config_.past_view_interval);
  const RangeView& past = views_[views_.size() - (age + 1) * interval];
  const auto sight = past.look_at(point_map);
  if (!sight) return PastSight::unknown;
  if (sight->nearest_m > sight->point_range_m + margin(sight->point_range_m))
    return PastSight::free;
  if (!sight->movable) return PastSight::unknown;
  if (std::abs(sight->range_m - sight->point_range_m) < same_surface_m) return PastSight::same;
  const float gap = sight->point_range_m - sight->range_m;
  if (gap < margin(sight->range_m) || gap > max_gone_gap_m) return PastSight::unknown;
  const Eigen::Vector3f surface_map = past.origin_map() + sight->range_m * sight->direction_map;
  return sees_through(now, surface_map) ? PastSight::gone_before_it : PastSight::unknown;
}

bool PastViews::sees_through(const RangeView& view, const Eigen::Vector3f& point_map) const {
  const auto sight = view.look_at(point_map);
  return sight && sight->nearest_m > sight->point_range_m + margin(sight->point_range_m);
}

void PastViews::add(RangeView view) {
  views_.push_back(std::move(view));
  const auto kept = static_cast<std::size_t>(config_.past_views * config_.past_view_interval);
  if (views_.size() > kept) views_.pop_front();
}

}  // namespace stillmap
