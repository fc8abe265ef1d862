#include "core/evaluation/segmentation_score.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace stillmap::evaluation {

void SegmentationScore::add(std::span<const Eigen::Vector3f> points_lidar,
                            std::span<const SemanticClass> truth,
                            std::span<const SemanticClass> predicted) {
  if (!points_lidar.empty() && points_lidar.size() != truth.size()) {
    throw std::invalid_argument("truth labels " + std::to_string(truth.size()) +
                                " points, the scan has " + std::to_string(points_lidar.size()));
  }
  all_.add(truth, predicted);
  for (std::size_t i = 0; i < points_lidar.size(); ++i) {
    const float range_m = points_lidar[i].norm();
    const auto border = std::ranges::find_if(borders_m, [&](float m) { return range_m < m; });
    const auto band = static_cast<std::size_t>(border - borders_m.begin());
    bands_[band].add(truth.subspan(i, 1), predicted.subspan(i, 1));
  }
}

void SegmentationScore::add(const SegmentationScore& other) {
  all_.add(other.all_);
  for (std::size_t band = 0; band < band_count; ++band) bands_[band].add(other.bands_[band]);
}

std::optional<double> mean_iou_of_groups(const ConfusionMatrix& matrix) {
  double sum = 0.0;
  int present = 0;
  for (const ClassGroup& group : coarse_groups()) {
    const std::optional<double> of_group = matrix.iou(group.classes);
    sum += of_group.value_or(0.0);
    present += of_group.has_value() ? 1 : 0;
  }
  if (present == 0) return std::nullopt;
  return sum / present;
}

}  // namespace stillmap::evaluation
