#pragma once

#include <memory>

#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// The labels that come with a scan where it has any; else those of another source. So recordings
/// with true labels keep them, and all other scans get semantics from the network.
class StreamFirstLabels final : public LabelSource {
 public:
  explicit StreamFirstLabels(std::unique_ptr<LabelSource> otherwise);

  [[nodiscard]] std::string name() const override;
  [[nodiscard]] std::string details() const override { return otherwise_->details(); }
  [[nodiscard]] std::vector<double> costs() const override { return otherwise_->costs(); }
  void set_coarseness(std::size_t coarseness) override { otherwise_->set_coarseness(coarseness); }
  [[nodiscard]] int image_columns() const override {
    return uses_stream_ ? 0 : otherwise_->image_columns();
  }
  [[nodiscard]] PointLabels label(const Scan& scan) override;

 private:
  std::unique_ptr<LabelSource> otherwise_;
  /// The last scan brought labels.
  bool uses_stream_ = false;
};

}  // namespace stillmap
