#pragma once

#include <cstdint>
#include <string>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// What the numbers of labels in a cloud's field or a file are.
enum class LabelKind {
  /// Original SemanticKITTI ids (10 = car); moving ids are reduced to their class.
  semantic_kitti,
  /// Stillmap's classes, 0..19, which SemanticKITTI's tools call train ids.
  classes,
};

/// Labels from here on are no whole numbers in a float of 32 bits: an id with its instance is
/// rounded to another id there.
inline constexpr double first_inexact_float_label = 16777216.0;

/// The class of a label as it is in a field or a file, whose upper 16 bits are the instance.
/// Numbers that the kind does not have give `unlabeled`.
[[nodiscard]] SemanticClass class_of_label(std::uint32_t raw_label, LabelKind kind);

/// Tells from labels that are read as SemanticKITTI's whether they are: what is taken for the other
/// kind makes a map of wrong classes.
class LabelCensus {
 public:
  void add(std::uint32_t raw_label);

  /// Without ids 0 and 65535 (-1 in 16 bits), which stand for "no label".
  [[nodiscard]] std::uint64_t labels() const { return labels_; }
  /// Of these, with an id that SemanticKITTI does not have; they count as unlabeled.
  [[nodiscard]] std::uint64_t unknown() const { return unknown_; }
  /// More ids are classes that SemanticKITTI does not use as ids than are beyond the classes. 255,
  /// which stands for "ignore" beside classes, is neither.
  [[nodiscard]] bool look_like_classes() const { return classes_alone_ > beyond_classes_; }
  /// What is wrong with them, as the end of a sentence: "look like classes 0 to 19: ..."; empty
  /// where they are what they are read as, but for a few.
  [[nodiscard]] std::string doubt() const;

 private:
  std::uint64_t labels_ = 0;
  std::uint64_t unknown_ = 0;
  std::uint64_t classes_alone_ = 0;
  std::uint64_t beyond_classes_ = 0;
};

}  // namespace stillmap
