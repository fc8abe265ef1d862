#pragma once

#include <string>
#include <vector>

#include "clients/terminal/json.hpp"
#include "core/evaluation/segmentation_score.hpp"

namespace stillmap::cli {

struct SequenceScore {
  std::string sequence;
  evaluation::SegmentationScore score;
};

/// IoU by class, group and range of all sequences together, and the means of each; nothing by range
/// where the score has none.
[[nodiscard]] Json segmentation_json(const std::vector<SequenceScore>& sequences);
/// The same as tables.
[[nodiscard]] std::string segmentation_text(const std::vector<SequenceScore>& sequences);

}  // namespace stillmap::cli
