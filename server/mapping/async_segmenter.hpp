#pragma once

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/segmentation_pipeline.hpp"
#include "server/mapping/segmentation_rate_controller.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/throttled_log.hpp"
#include "server/threads/bounded_queue.hpp"

namespace stillmap::server {

/// How long a scan of this server may wait for its labels; 0: as long as it takes.
[[nodiscard]] std::chrono::milliseconds segmentation_budget(const ServerConfig& config);

/// A label source that may be slower than the sensor: it runs in a thread of its own, looks as
/// coarsely as it must and then takes every n-th scan, none while others wait to be mapped, and
/// nobody waits for it longer than the budget, or at all when it lately took longer than that. Its
/// exceptions are counted and leave a scan without labels. The mapping thread calls it.
class AsyncSegmenter final : public SegmentationPipeline {
 public:
  /// With a budget of 0 the source runs in the caller's thread and gets every scan. The queue is
  /// that of the scans to come.
  AsyncSegmenter(std::unique_ptr<Segmenter> source, std::chrono::milliseconds budget,
                 const ScanQueue& queue, Statistics& statistics);
  /// Waits for the scan in work.
  ~AsyncSegmenter() override;

  [[nodiscard]] std::string name() const override { return name_; }
  [[nodiscard]] bool may_skip_scans() const override { return budget_.count() > 0; }
  [[nodiscard]] Output submit(const Scan& scan) override;

 private:
  using Clock = std::chrono::steady_clock;

  void work(const std::stop_token& stop);
  /// The scan's labels, none after a failure.
  [[nodiscard]] ScanLabels segment(const Scan& scan);
  void record_duration(double network_ms);
  /// In the status, and in the log.
  void report_rate();
  void log_rate_change(bool is_slower) const;
  /// Whether the thread is to take the scan that is offered now.
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
  std::condition_variable_any changed_;
  SegmentationRateController rate_controller_;
  std::uint32_t scans_since_segmented_ = 0;
  /// Scans in a row whose labels came after the budget; scans since then that did not wait.
  std::uint32_t misses_ = 0;
  std::uint32_t scans_without_wait_ = 0;
  /// Taken from here by the thread, which is busy until it hands in the result.
  std::optional<Scan> job_;
  bool busy_ = false;
  std::vector<ScanLabels> finished_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
