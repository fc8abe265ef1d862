#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/segmentation_pipeline.hpp"
#include "server/mapping/scan_queue.hpp"
#include "server/mapping/segmentation_rate_controller.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// How long a scan of this server may wait for its labels; 0: as long as it takes.
[[nodiscard]] std::chrono::milliseconds segmentation_budget(const ServerConfig& config);

/// Runs a segmenter that may be slower than the sensor on a thread of its own: at a resolution that
/// keeps the sensor's rate, then for every n-th scan, and for none while others wait to be mapped.
/// The mapping thread waits for labels up to the budget, and not at all when the last ones took
/// longer than that. Exceptions of the segmenter are counted and leave a scan without labels.
class AsyncSegmenter final : public SegmentationPipeline {
 public:
  /// With a budget of 0 the source runs in the caller's thread and gets every scan. `queue` holds
  /// the scans that wait to be mapped.
  AsyncSegmenter(std::unique_ptr<Segmenter> source, std::chrono::milliseconds budget,
                 const ScanQueue& queue, Statistics& statistics);

  [[nodiscard]] std::string name() const override { return name_; }
  [[nodiscard]] bool may_skip_scans() const override { return budget_.count() > 0; }
  [[nodiscard]] Output submit(const Scan& scan) override;

 private:
  using Clock = std::chrono::steady_clock;

  /// The scan's labels, none after a failure.
  [[nodiscard]] ScanLabels segment(const Scan& scan);
  void record_duration(double network_ms);
  void report_rate();
  void log_rate_change(bool is_slower) const;
  /// Whether the scan that is submitted now is to be segmented.
  [[nodiscard]] bool is_due();
  [[nodiscard]] bool should_wait();

  std::unique_ptr<Segmenter> source_;
  std::string name_;
  int full_columns_;
  std::chrono::milliseconds budget_;
  const ScanQueue& queue_;
  Statistics& statistics_;
  /// Used where the source runs.
  ThrottledLog throttled_log_;

  std::mutex mutex_;
  std::condition_variable finished_changed_;
  SegmentationRateController rate_controller_;
  std::uint32_t scans_since_segmented_ = 0;
  /// Scans in a row whose labels came after the budget; scans since then that did not wait.
  std::uint32_t misses_ = 0;
  std::uint32_t scans_without_wait_ = 0;
  /// A scan was submitted, and its labels are not in `finished_` yet.
  bool busy_ = false;
  std::vector<ScanLabels> finished_;
  BoundedQueue<Scan> submitted_{1};
  // Last: stops before what it uses is gone, after the scan in work.
  std::optional<Worker<Scan>> worker_;
};

}  // namespace stillmap::server
