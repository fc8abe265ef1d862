#include "clients/commands/evaluate/segmentation_run.hpp"

#include "core/dataset/kitti_files.hpp"

namespace stillmap::cli {

SegmentationResult segment_dataset(const ScanDataset& dataset, const ScanRange& range,
                                   Segmenter& labels, const ScanDone& scan_done) {
  SegmentationResult result;
  StageStopwatch times;
  const std::size_t end = range.end(dataset);
  for (std::size_t index = range.first; index < end; ++index) {
    if (dataset.has_labels(index)) {
      DatasetFrame frame = dataset.read(index);
      frame.scan.labels.clear();
      times.begin();
      const PointLabels found = labels.segment(frame.scan);
      times.end();
      result.points.add(reduced_classes(frame.raw_labels), found.classes);
      result.scans += 1;
    }
    if (scan_done && !scan_done(index + 1 - range.first)) break;
  }
  result.median_ms = times.total().quantile(0.5);
  result.p99_ms = times.total().quantile(0.99);
  return result;
}

}  // namespace stillmap::cli
