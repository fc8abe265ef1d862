#include "core/segmentation/fallback_segmenter.hpp"

#include <utility>

#include "core/segmentation/passthrough_segmenter.hpp"

namespace stillmap {

FallbackSegmenter::FallbackSegmenter(std::unique_ptr<Segmenter> fallback)
    : fallback_(std::move(fallback)) {}

std::string FallbackSegmenter::name() const {
  return PassthroughSegmenter().name() + ", else " + fallback_->name();
}

PointLabels FallbackSegmenter::segment(const Scan& scan) {
  uses_stream_ = !scan.labels.empty();
  return uses_stream_ ? PassthroughSegmenter().segment(scan) : fallback_->segment(scan);
}

}  // namespace stillmap
