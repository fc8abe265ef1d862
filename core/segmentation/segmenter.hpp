#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// Where the class of a point comes from: a recording's labels, a network, or nowhere.
class Segmenter {
 public:
  virtual ~Segmenter() = default;

  /// Name for the status: "stream", "none", or the model's name.
  [[nodiscard]] virtual std::string name() const = 0;

  /// How it works, in words for a log; empty when there is nothing to say.
  [[nodiscard]] virtual std::string details() const { return {}; }

  /// Time that a scan takes at each resolution level that this source knows, as a share of the
  /// finest's, which comes first; the others are less, each less than the one before.
  [[nodiscard]] virtual std::vector<double> relative_costs() const { return {1.0}; }
  /// How coarsely to look at the next scans: an index of relative_costs().
  virtual void set_resolution_level(std::size_t /*resolution_level*/) {}
  /// Width of the range images that it looks at now; 0: it looks at none.
  [[nodiscard]] virtual int image_columns() const { return 0; }

  /// Classes of the scan's points; empty when this source has none for this scan.
  [[nodiscard]] virtual PointLabels segment(const Scan& scan) = 0;
};

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
