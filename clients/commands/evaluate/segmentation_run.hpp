#pragma once

#include "clients/commands/mapping/mapping_run.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/evaluation/confusion_matrix.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {

struct SegmentationResult {
  evaluation::ConfusionMatrix points;
  std::size_t scans = 0;
  /// From scan to the class of every point.
  double median_ms = 0.0;
  double p99_ms = 0.0;
};

/// Labels the scans of a labelled recording and compares with its labels. Scans without labels
/// are left out. Throws DatasetError for a damaged file.
[[nodiscard]] SegmentationResult segment_dataset(const ScanDataset& dataset, const ScanRange& range,
                                                 Segmenter& labels, const ScanDone& scan_done);

}  // namespace stillmap::cli
