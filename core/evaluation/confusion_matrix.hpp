#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "core/lidar/semantic_class.hpp"

namespace stillmap::evaluation {

/// Counts of (true class, predicted class), as semantic-kitti-api counts them: points whose truth
/// is `unlabeled` are left out, a labelled point that was predicted `unlabeled` is a miss.
class ConfusionMatrix {
 public:
  /// Counts one scan. Throws std::invalid_argument when the lengths differ.
  void add(std::span<const SemanticClass> truth, std::span<const SemanticClass> predicted);
  /// Counts what another matrix has counted, too.
  void add(const ConfusionMatrix& other);

  [[nodiscard]] std::uint64_t count(SemanticClass truth, SemanticClass predicted) const;
  /// Points counted.
  [[nodiscard]] std::uint64_t total() const;

  /// TP / (TP + FP + FN); empty for a class that is neither in the truth nor predicted.
  [[nodiscard]] std::optional<double> iou(SemanticClass label) const;
  /// The same with the classes of the group counted as one. No class may appear twice.
  [[nodiscard]] std::optional<double> iou(std::span<const SemanticClass> group) const;
  /// Mean over all 19 classes; one that never occurs counts 0, as in semantic-kitti-api.
  [[nodiscard]] double mean_iou() const;
  /// Mean over the classes that are in the truth or predicted; empty when there are none.
  [[nodiscard]] std::optional<double> mean_iou_of_present() const;
  /// Share of points with the right class; empty when no point was counted.
  [[nodiscard]] std::optional<double> accuracy() const;

 private:
  std::array<std::array<std::uint64_t, semantic_class_count>, semantic_class_count> counts_{};
};

/// Classes that count as one, for a score that forgives confusions among them.
struct ClassGroup {
  std::string_view name;
  std::span<const SemanticClass> classes;
};

/// Drivable ground, other ground, structure, vehicle, person, nature, pole-like: the groups of
/// SemanticKITTI's coarse task, which takes terrain for nature. Each of the 19 classes is in one.
[[nodiscard]] std::array<ClassGroup, 7> coarse_groups();

}  // namespace stillmap::evaluation
