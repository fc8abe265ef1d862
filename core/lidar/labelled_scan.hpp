#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// Class and confidence of every point of a scan. Both vectors are empty when there are no labels
/// (pure geometry), else as long as the scan.
struct PointLabels {
  std::vector<SemanticClass> classes;
  /// Probability of the class, 0..1.
  std::vector<float> confidence;

  [[nodiscard]] bool empty() const { return classes.empty(); }
};

/// The paper's three kinds of points (II-C.2).
enum class Motion : std::uint8_t {
  /// Buildings, ground, poles: in the local map and in the static map.
  stationary = 0,
  /// Could move and stands still, as a parked car: in the local map, not in the static map.
  semi_static = 1,
  /// Moving now: in neither map.
  highly_dynamic = 2,
};

/// A prepared scan with what is known of each point. `labels` may be empty, `motion` is as long as
/// the scan.
struct LabelledScan {
  Scan scan;
  PointLabels labels;
  std::vector<Motion> motion;

  /// Class of point i, `unlabeled` when there are no labels.
  [[nodiscard]] SemanticClass label(std::size_t i) const {
    return labels.empty() ? SemanticClass::unlabeled : labels.classes[i];
  }
};

}  // namespace stillmap
