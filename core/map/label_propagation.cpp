#include "core/map/label_propagation.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <utility>

namespace stillmap {
namespace {

/// Columns of a labelled view: 0.7 degrees each. Finer ones would make the window for a point that
/// moved on by a metre too many pixels.
constexpr int view_columns = 512;
/// Widest window to each side, in pixels: near the lidar a metre is wider, and points are dense.
constexpr int max_reach = 5;
constexpr double full_turn = 2.0 * std::numbers::pi;

/// Pixels to each side within which points `distance_m` apart can lie, seen from `range_m`.
int reach(double distance_m, double range_m, double rad_per_pixel) {
  const double pixels = distance_m / (range_m * rad_per_pixel);
  return pixels < max_reach ? static_cast<int>(pixels) + 1 : max_reach;
}

}  // namespace

LabelledRangeImage::LabelledRangeImage(const Scan& scan, const PointLabels& labels,
                                       const Eigen::Isometry3d& T_map_lidar,
                                       const SensorModel& sensor)
    : T_lidar_map_(T_map_lidar.inverse().cast<float>()), projection_(projection_model(sensor)) {
  assert(labels.classes.size() == scan.size());
  projection_.columns = view_columns;
  const RangeImage image(scan.points_lidar, projection_);
  pixels_.resize(image.pixel_count());
  for (std::size_t pixel = 0; pixel < pixels_.size(); ++pixel) {
    const std::int32_t nearest = image.nearest()[pixel];
    if (nearest == RangeImage::none) continue;
    const auto i = static_cast<std::size_t>(nearest);
    pixels_[pixel].point_lidar = scan.points_lidar[i];
    pixels_[pixel].label = labels.classes[i];
    pixels_[pixel].confidence = labels.confidence[i];
  }
  mark_near_movable();
}

template <class Use>
void LabelledRangeImage::for_ring(const Direction& centre, int ring, Use use) const {
  for (int down = -ring; down <= ring; ++down) {
    const int row = centre.row + down;
    if (row < 0 || row >= projection_.rows) continue;
    // The first and last rows of the ring are full, those between have two ends.
    const int step = std::abs(down) == ring ? 1 : 2 * ring;
    for (int aside = -ring; aside <= ring; aside += step) {
      const int column = (centre.column + aside + projection_.columns) % projection_.columns;
      use(static_cast<std::size_t>(row * projection_.columns + column));
    }
  }
}

void LabelledRangeImage::mark_near_movable() {
  for (std::size_t pixel = 0; pixel < pixels_.size(); ++pixel) {
    if (!is_movable(pixels_[pixel].label)) continue;
    const auto columns = static_cast<std::size_t>(projection_.columns);
    const Direction centre{static_cast<int>(pixel / columns), static_cast<int>(pixel % columns)};
    for (int ring = 0; ring <= max_reach; ++ring) {
      for_ring(centre, ring, [this](std::size_t around) { pixels_[around].near_movable = true; });
    }
  }
}

LabelledRangeImage::Direction LabelledRangeImage::direction_of(const Eigen::Vector3f& p) const {
  const float range_m = p.norm();
  if (!(range_m > 0.0F && std::isfinite(range_m))) return {};
  const float elevation = std::asin(std::clamp(p.z() / range_m, -1.0F, 1.0F));
  const double down = projection_.fov_up - static_cast<double>(elevation);
  const double turn = 0.5 - static_cast<double>(std::atan2(p.y(), p.x())) / full_turn;
  const double rows_per_rad = projection_.rows / (projection_.fov_up - projection_.fov_down);
  return {std::clamp(static_cast<int>(std::floor(down * rows_per_rad)), 0, projection_.rows - 1),
          std::clamp(static_cast<int>(turn * projection_.columns), 0, projection_.columns - 1),
          range_m};
}

bool LabelledRangeImage::may_be_near_movable(const Eigen::Vector3d& point_map) const {
  const Direction at = direction_of(T_lidar_map_ * point_map.cast<float>());
  return pixels_[static_cast<std::size_t>(at.row * projection_.columns + at.column)].near_movable;
}

std::optional<LabelledRangeImage::Neighbour> LabelledRangeImage::nearest(
    const Eigen::Vector3d& point_map, double max_distance_m) const {
  const Eigen::Vector3f p = T_lidar_map_ * point_map.cast<float>();
  const Direction at = direction_of(p);
  if (!(at.range_m > 0.0F)) return std::nullopt;
  const double rad_per_row = (projection_.fov_up - projection_.fov_down) / projection_.rows;
  const double rad_per_pixel = std::min(rad_per_row, full_turn / projection_.columns);
  const int rings = reach(max_distance_m, at.range_m, rad_per_pixel);
  const auto pixel_m = static_cast<float>(rad_per_pixel) * at.range_m;
  const Pixel* best = nullptr;
  auto best_squared = static_cast<float>(max_distance_m * max_distance_m);
  for (int ring = 0; ring <= rings; ++ring) {
    // From here on, all points are farther away than what was found.
    const float closest_m = static_cast<float>(std::max(ring - 1, 0)) * pixel_m;
    if (best != nullptr && closest_m * closest_m > best_squared) break;
    const auto compare = [&](std::size_t around) {
      const Pixel& pixel = pixels_[around];
      if (pixel.label == SemanticClass::unlabeled) return;
      const float squared = (pixel.point_lidar - p).squaredNorm();
      if (squared > best_squared) return;
      best = &pixel;
      best_squared = squared;
    };
    for_ring(at, ring, compare);
  }
  if (best == nullptr) return std::nullopt;
  return Neighbour{best->label, best->confidence, std::sqrt(best_squared)};
}

namespace {

struct PropagatedLabel {
  SemanticClass label = SemanticClass::unlabeled;
  float confidence = 0.0F;
  LabelOrigin origin = LabelOrigin::none;
};

PropagatedLabel propagate(const Eigen::Vector3d& point_map, double range_m, const StaticMap* map,
                          const std::optional<LabelledRangeImage>& last_labelled,
                          const LabelPropagationConfig& config) {
  const ClassEvidence evidence = map == nullptr ? ClassEvidence() : map->evidence_at(point_map);
  const SemanticClass known = evidence.winner();
  std::optional<LabelledRangeImage::Neighbour> neighbour;
  if (last_labelled && known == SemanticClass::unlabeled) {
    neighbour = last_labelled->nearest(point_map,
                                       config.max_distance_m + config.max_distance_share * range_m);
  } else if (last_labelled && last_labelled->may_be_near_movable(point_map)) {
    neighbour = last_labelled->nearest(point_map, config.movable_distance_m);
  }
  if (neighbour && (known == SemanticClass::unlabeled || is_movable(neighbour->label))) {
    return {neighbour->label, config.confidence_factor * neighbour->confidence,
            LabelOrigin::last_scan};
  }
  if (known == SemanticClass::unlabeled) return {};
  return {known, config.confidence_factor * evidence.share(), LabelOrigin::map};
}

}  // namespace

PropagatedLabels propagate_labels(const Scan& scan, const Eigen::Isometry3d& T_map_lidar,
                                  const StaticMap* map,
                                  const std::optional<LabelledRangeImage>& last_labelled,
                                  const LabelPropagationConfig& config) {
  PropagatedLabels propagated;
  propagated.labels.classes.resize(scan.size());
  propagated.labels.confidence.resize(scan.size());
  propagated.origin.resize(scan.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.size(), 2048), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) {
      const Eigen::Vector3d point_lidar = scan.points_lidar[i].cast<double>();
      const PropagatedLabel one =
          propagate(T_map_lidar * point_lidar, point_lidar.norm(), map, last_labelled, config);
      propagated.labels.classes[i] = one.label;
      propagated.labels.confidence[i] = one.confidence;
      propagated.origin[i] = one.origin;
    }
  });
  return propagated;
}

PointLabels new_evidence(const PropagatedLabels& propagated) {
  PointLabels labels = propagated.labels;
  for (std::size_t i = 0; i < propagated.origin.size(); ++i) {
    if (propagated.origin[i] != LabelOrigin::last_scan) labels.confidence[i] = 0.0F;
  }
  return labels;
}

}  // namespace stillmap
