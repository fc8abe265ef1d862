#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// Where the labels of a scan come from.
enum class Labelling : std::uint8_t {
  /// No point has a class.
  none,
  /// From the label source, for this scan.
  fresh,
  /// From the map and the last labelled scan, as the label source was not ready in time.
  carried,
};

/// What a label source made of one scan.
struct ScanLabels {
  std::int64_t stamp_ns = 0;
  /// Empty when the source has none for this scan, or failed.
  PointLabels labels;
};

/// Labels that may come later than a scan can wait for them.
class LabelFeed {
 public:
  virtual ~LabelFeed() = default;

  /// Name of the source, for the status.
  [[nodiscard]] virtual std::string name() const = 0;

  /// False: every offer brings the labels of its scan, nothing ever has to be carried over.
  [[nodiscard]] virtual bool may_skip_scans() const = 0;

  struct Answer {
    /// Finished since the last call, oldest first; for this scan too, if it did not take too long.
    std::vector<ScanLabels> finished;
    /// This scan's labels will be in a later answer.
    bool pending = false;
  };
  /// Offers a prepared scan to be labelled.
  [[nodiscard]] virtual Answer offer(const Scan& scan) = 0;
};

/// Every scan waits for its labels, however long that takes.
class PatientFeed final : public LabelFeed {
 public:
  explicit PatientFeed(std::unique_ptr<LabelSource> source) : source_(std::move(source)) {}

  [[nodiscard]] std::string name() const override { return source_->name(); }
  [[nodiscard]] bool may_skip_scans() const override { return false; }
  [[nodiscard]] Answer offer(const Scan& scan) override {
    Answer answer;
    answer.finished.push_back({scan.stamp_ns, source_->label(scan)});
    return answer;
  }

 private:
  std::unique_ptr<LabelSource> source_;
};

}  // namespace stillmap
