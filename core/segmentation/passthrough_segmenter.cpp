#include "core/segmentation/passthrough_segmenter.hpp"

#include <algorithm>
#include <cassert>

namespace stillmap {

PointLabels PassthroughSegmenter::segment(const Scan& scan) {
  assert(scan.labels.empty() || scan.labels.size() == scan.size());
  PointLabels labels{.classes = scan.labels, .confidence = {}};
  labels.confidence.resize(scan.labels.size());
  std::ranges::transform(scan.labels, labels.confidence.begin(), [](SemanticClass label) {
    return label == SemanticClass::unlabeled ? 0.0F : 1.0F;
  });
  return labels;
}

}  // namespace stillmap
