#pragma once

#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// Labels that came with the scan: a recording's, or a cloud's label field. Each counts in full
/// (confidence 1), an unlabeled point not at all. A scan without labels stays without.
class PassthroughSegmenter final : public Segmenter {
 public:
  [[nodiscard]] std::string name() const override { return "stream"; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override;
};

/// Pure geometry: no point has a class, even if the scan brings labels.
class NullSegmenter final : public Segmenter {
 public:
  [[nodiscard]] std::string name() const override { return "none"; }
  [[nodiscard]] PointLabels segment(const Scan& /*scan*/) override { return {}; }
};

}  // namespace stillmap
