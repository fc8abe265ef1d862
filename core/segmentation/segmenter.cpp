#include "core/segmentation/segmenter.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace stillmap {

PointLabels PassthroughSegmenter::segment(const Scan& scan) {
  assert(scan.labels.empty() || scan.labels.size() == scan.size());
  if (!has_known_class(scan.labels)) return {};
  PointLabels labels{.classes = scan.labels, .confidence = {}};
  labels.confidence.resize(scan.labels.size());
  std::ranges::transform(scan.labels, labels.confidence.begin(), [](SemanticClass label) {
    return label == SemanticClass::unlabeled ? 0.0F : 1.0F;
  });
  return labels;
}

FallbackSegmenter::FallbackSegmenter(std::unique_ptr<Segmenter> fallback)
    : fallback_(std::move(fallback)) {}

std::string FallbackSegmenter::name() const {
  return PassthroughSegmenter().name() + ", else " + fallback_->name();
}

PointLabels FallbackSegmenter::segment(const Scan& scan) {
  const bool is_labelled = has_labels(scan);
  uses_stream_ = is_labelled;
  return is_labelled ? PassthroughSegmenter().segment(scan) : fallback_->segment(scan);
}

}  // namespace stillmap
