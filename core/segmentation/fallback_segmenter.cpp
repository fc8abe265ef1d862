#include "core/segmentation/fallback_segmenter.hpp"

#include <utility>

#include "core/segmentation/passthrough_segmenter.hpp"

namespace stillmap {

StreamFirstLabels::StreamFirstLabels(std::unique_ptr<LabelSource> otherwise)
    : otherwise_(std::move(otherwise)) {}

std::string StreamFirstLabels::name() const {
  return StreamLabels().name() + ", else " + otherwise_->name();
}

PointLabels StreamFirstLabels::label(const Scan& scan) {
  uses_stream_ = !scan.labels.empty();
  return uses_stream_ ? StreamLabels().label(scan) : otherwise_->label(scan);
}

}  // namespace stillmap
