#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

#include "core/evaluation/confusion_matrix.hpp"

namespace stillmap::evaluation {

/// How well classes were found, of all points and by range: what is right near the sensor may be
/// wrong where returns are few.
class SegmentationScore {
 public:
  /// Upper ends of the bands of range; the last band has none [m].
  static constexpr std::array borders_m{10.0F, 20.0F, 40.0F};
  static constexpr std::size_t band_count = borders_m.size() + 1;

  /// Counts one scan; points in the lidar frame [m], or none where only the classes are known: then
  /// it counts in no band. Throws std::invalid_argument when the lengths differ.
  void add(std::span<const Eigen::Vector3f> points_lidar, std::span<const SemanticClass> truth,
           std::span<const SemanticClass> predicted);
  /// Counts the scans of another score, too.
  void add(const SegmentationScore& other);

  [[nodiscard]] const ConfusionMatrix& all() const { return all_; }
  /// The first band begins at 0 m, every other one where the one before ends.
  [[nodiscard]] const ConfusionMatrix& band(std::size_t number) const { return bands_.at(number); }

 private:
  ConfusionMatrix all_;
  std::array<ConfusionMatrix, band_count> bands_;
};

/// Mean IoU of the coarse groups that are in the truth or predicted; empty when there are none.
[[nodiscard]] std::optional<double> mean_iou_of_groups(const ConfusionMatrix& matrix);

}  // namespace stillmap::evaluation
