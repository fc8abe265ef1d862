#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/segmentation_pipeline.hpp"
#include "server/mapping/parallelism_controller.hpp"
#include "server/mapping/scan_queue.hpp"
#include "server/mapping/segmentation_rate_controller.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// How long a scan of this server may wait for its labels; 0: as long as it takes.
[[nodiscard]] std::chrono::milliseconds segmentation_budget(const ServerConfig& config);

/// Runs a segmenter that may be slower than the sensor on threads of its own: at a resolution that
/// keeps the sensor's rate, then with a core for each of several scans (ParallelismController),
/// then for every n-th scan, and for none while others wait to be mapped. The mapping thread waits
/// for labels up to the budget, and not at all when the last ones took longer than that. Exceptions
/// of the segmenter are counted and leave a scan without labels.
class AsyncSegmenter final : public SegmentationPipeline {
 public:
  /// With a budget of 0 the source runs in the caller's thread and gets every scan. `queue` holds
  /// the scans that wait to be mapped.
  AsyncSegmenter(std::unique_ptr<Segmenter> source, std::chrono::milliseconds budget,
                 const ScanQueue& queue, Statistics& statistics);

  [[nodiscard]] std::string name() const override { return name_; }
  [[nodiscard]] bool may_skip_scans() const override { return budget_.count() > 0; }
  [[nodiscard]] Output submit(const Scan& scan) override;
  void set_mount(const Eigen::Isometry3d& T_base_lidar) override {
    source_->set_mount(T_base_lidar);
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t latency_window = 5;

  struct Submitted {
    std::uint64_t number = 0;
    Scan scan;
  };

  /// The scan's labels, none after a failure.
  [[nodiscard]] ScanLabels segment(const Scan& scan);
  void record_duration(Parallelism parallelism, double network_ms);
  void adapt_rate(double network_ms);
  /// What a scan takes; before the first one at a new resolution or parallelism, the expected time.
  [[nodiscard]] double latency_ms() const;
  /// Of the present resolution, relative to the coarsest one.
  [[nodiscard]] double relative_cost() const;
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

  /// Of all below.
  std::mutex mutex_;
  ThrottledLog throttled_log_;
  std::condition_variable finished_changed_;
  SegmentationRateController rate_controller_;
  ParallelismController parallelism_controller_;
  /// From a scan to its labels at the present resolution and parallelism, whatever was worked on
  /// beside it.
  RecentMedian latency_ms_{latency_window};
  std::uint32_t scans_since_segmented_ = 0;
  /// Scans in a row whose labels came after the budget; scans since then that did not wait.
  std::uint32_t misses_ = 0;
  std::uint32_t scans_without_wait_ = 0;
  std::uint64_t submissions_ = 0;
  /// Numbers of the scans that were submitted and whose labels are not in `finished_` yet.
  std::set<std::uint64_t> in_work_;
  std::vector<ScanLabels> finished_;
  BoundedQueue<Submitted> submitted_;
  // Last: they stop before what they use is gone, after the scans in work.
  std::deque<Worker<Submitted>> workers_;
};

}  // namespace stillmap::server
