#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// Source of the points' classes: labels that come with the scans, a network, or none.
class Segmenter {
 public:
  virtual ~Segmenter() = default;

  /// Name for the status: "stream", "none", or the model's name.
  [[nodiscard]] virtual std::string name() const = 0;

  /// Engine and image size in words for the log; may be empty.
  [[nodiscard]] virtual std::string details() const { return {}; }

  /// Time per scan at each resolution level, relative to the finest, which comes first; strictly
  /// decreasing.
  [[nodiscard]] virtual std::vector<double> relative_costs() const { return {1.0}; }
  /// Sets the resolution for the next scans: an index into relative_costs().
  virtual void set_resolution_level(std::size_t /*resolution_level*/) {}
  /// Current width of its range images; 0 when it uses none.
  [[nodiscard]] virtual int image_columns() const { return 0; }

  /// Classes of the scan's points; empty when there are none for this scan.
  [[nodiscard]] virtual PointLabels segment(const Scan& scan) = 0;
};

/// Labels that come with the scan, from a dataset or a point cloud's label field, with confidence 1
/// (0 for unlabeled points). No labels for a scan without them.
class PassthroughSegmenter final : public Segmenter {
 public:
  [[nodiscard]] std::string name() const override { return "stream"; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override;
};

/// No labels, even if the scan has some: a map of geometry alone.
class NullSegmenter final : public Segmenter {
 public:
  [[nodiscard]] std::string name() const override { return "none"; }
  [[nodiscard]] PointLabels segment(const Scan& /*scan*/) override { return {}; }
};

/// The labels that come with the scan; for scans without labels those of another segmenter.
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
  /// The last scan had labels of its own.
  bool uses_stream_ = false;
};

}  // namespace stillmap
