#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// Where the labels of a scan come from.
enum class LabelProvenance : std::uint8_t {
  /// No point has a class.
  none,
  /// From the label source, for this scan.
  fresh,
  /// From the map and the last labelled scan: the label source was not ready in time.
  propagated,
};

/// Result of a label source for one scan.
struct ScanLabels {
  std::int64_t stamp_ns = 0;
  /// Empty when the source has none for this scan, or failed.
  PointLabels labels;
};

/// Segments scans; the labels of a scan may be finished after a later scan was submitted.
class SegmentationPipeline {
 public:
  virtual ~SegmentationPipeline() = default;

  /// Name of the label source, for the status.
  [[nodiscard]] virtual std::string name() const = 0;

  /// False: every submit() returns the labels of its scan, none are ever propagated.
  [[nodiscard]] virtual bool may_skip_scans() const = 0;

  struct Output {
    /// Finished since the last call, oldest first; for this scan too, if it did not take too long.
    std::vector<ScanLabels> finished;
    /// This scan's labels will be in a later output.
    bool pending = false;
  };
  /// Submits a prepared scan for segmentation.
  [[nodiscard]] virtual Output submit(const Scan& scan) = 0;

  /// See Segmenter.
  virtual void set_mount(const Eigen::Isometry3d& /*T_base_lidar*/) {}
};

/// Segments every scan within submit(), however long that takes.
class BlockingSegmenter final : public SegmentationPipeline {
 public:
  explicit BlockingSegmenter(std::unique_ptr<Segmenter> source) : source_(std::move(source)) {}

  [[nodiscard]] std::string name() const override { return source_->name(); }
  [[nodiscard]] bool may_skip_scans() const override { return false; }
  [[nodiscard]] Output submit(const Scan& scan) override {
    Output output;
    output.finished.push_back({scan.stamp_ns, source_->segment(scan)});
    return output;
  }
  void set_mount(const Eigen::Isometry3d& T_base_lidar) override {
    source_->set_mount(T_base_lidar);
  }

 private:
  std::unique_ptr<Segmenter> source_;
};

}  // namespace stillmap
