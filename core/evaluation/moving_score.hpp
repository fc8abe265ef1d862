#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap::evaluation {

/// Detection of moving points against the truth. A rate is empty where it would divide by zero.
struct MovingScore {
  std::uint64_t true_positives = 0;
  std::uint64_t false_positives = 0;
  std::uint64_t false_negatives = 0;

  [[nodiscard]] std::optional<double> precision() const;
  [[nodiscard]] std::optional<double> recall() const;
  [[nodiscard]] std::optional<double> iou() const;

  MovingScore& operator+=(const MovingScore& other);
};

/// Scores Motion::highly_dynamic against SemanticKITTI's moving ids 252..259. Points whose truth is
/// unlabeled (0) or outlier (1) do not count. Throws std::invalid_argument when lengths differ.
[[nodiscard]] MovingScore moving_score(std::span<const Motion> motion,
                                       std::span<const std::uint16_t> original_ids);

}  // namespace stillmap::evaluation
