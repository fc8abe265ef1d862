#pragma once

#include <memory>

#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// The labels that come with a scan where it has any; else those of another source. So recordings
/// with true labels keep them, and all other scans get semantics from the network.
class FallbackSegmenter final : public Segmenter {
 public:
  explicit FallbackSegmenter(std::unique_ptr<Segmenter> fallback);

  [[nodiscard]] std::string name() const override;
  [[nodiscard]] std::string details() const override { return fallback_->details(); }
  [[nodiscard]] std::vector<double> relative_costs() const override {
    return fallback_->relative_costs();
  }
  void set_resolution_level(std::size_t resolution_level) override {
    fallback_->set_resolution_level(resolution_level);
  }
  [[nodiscard]] int image_columns() const override {
    return uses_stream_ ? 0 : fallback_->image_columns();
  }
  [[nodiscard]] PointLabels segment(const Scan& scan) override;

 private:
  std::unique_ptr<Segmenter> fallback_;
  /// The last scan brought labels.
  bool uses_stream_ = false;
};

}  // namespace stillmap
