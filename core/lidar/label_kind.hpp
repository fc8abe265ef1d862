#pragma once

#include <cstdint>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// What the numbers of labels in a cloud's field or a file are.
enum class LabelKind {
  /// Original SemanticKITTI ids (10 = car); moving ids are reduced to their class.
  semantic_kitti,
  /// Stillmap's classes, 0..19, which SemanticKITTI's tools call train ids.
  classes,
};

/// The class of a label as it is in a field or a file. Numbers that the kind does not have give
/// `unlabeled`.
[[nodiscard]] SemanticClass class_of_label(std::uint32_t raw_label, LabelKind kind);

/// Tells from labels that are read as SemanticKITTI's whether they are: what is taken for the other
/// kind makes a map of wrong classes.
class LabelCensus {
 public:
  void add(std::uint32_t raw_label);

  [[nodiscard]] std::uint64_t labels() const { return labels_; }
  /// Of these, with an id that SemanticKITTI does not have; they count as unlabeled.
  [[nodiscard]] std::uint64_t unknown() const { return unknown_; }
  /// Some ids are classes that SemanticKITTI does not use as ids, and none is beyond the classes.
  [[nodiscard]] bool look_like_classes() const { return unknown_ > 0 && largest_ <= last_class; }

 private:
  static constexpr std::uint32_t last_class = semantic_class_count - 1;

  std::uint64_t labels_ = 0;
  std::uint64_t unknown_ = 0;
  std::uint32_t largest_ = 0;
};

}  // namespace stillmap
