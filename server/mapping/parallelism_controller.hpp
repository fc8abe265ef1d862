#pragma once

#include <cstddef>

#include "core/segmentation/segmenter.hpp"
#include "server/monitoring/recent_values.hpp"

namespace stillmap::server {

/// Chooses whether all cores work on one scan or each on a scan of its own. All cores on one scan
/// are sooner done with it, and are the choice as long as they keep the sensor's rate, if only at
/// the coarsest resolution: then scans are registered with labels of their own. Beside other load
/// they wait for each other at the end of every layer: where that costs the rate, every core gets a
/// scan of its own, whose labels come later, but for more of the scans.
class ParallelismController {
 public:
  /// How many scans can be segmented at a time; with 1 there is nothing to choose.
  explicit ParallelismController(std::size_t concurrent_scans)
      : concurrent_scans_(concurrent_scans) {}

  /// A scan was segmented as `parallelism` says: in `coarsest_ms`, or it would have been at the
  /// coarsest resolution. To keep the sensor's rate, it has `room_ms` (0: not known).
  void add_measurement(Parallelism parallelism, double coarsest_ms, double room_ms);

  [[nodiscard]] Parallelism parallelism() const { return parallelism_; }
  /// How many scans may be in work at a time.
  [[nodiscard]] std::size_t scans_at_a_time() const {
    return parallelism_ == Parallelism::across_scans ? concurrent_scans_ : 1;
  }
  /// False after a change, until it has shown what it is worth.
  [[nodiscard]] bool is_settled() const {
    return concurrent_scans_ < 2 || coarsest_ms_.size() >= min_runs;
  }

 private:
  static constexpr std::size_t median_window = 5;
  /// The first runs take longer than the others: memory and threads are new.
  static constexpr std::size_t min_runs = 3;
  static constexpr int min_patience = 20;
  /// Half a minute of a usual sensor's scans.
  static constexpr int max_patience = 300;
  /// All cores on one scan keep the rate up to this share of the time that there is: scans do not
  /// come to the millisecond.
  static constexpr double late_share = 1.05;
  /// A core for each scan must save this much of the time between labels, since they come later.
  static constexpr double better_share = 0.9;

  void change_to(Parallelism parallelism);

  std::size_t concurrent_scans_;
  Parallelism parallelism_ = Parallelism::within_scan;
  /// From scan to labels, since the last change.
  RecentMedian coarsest_ms_{median_window};
  /// What a scan took when all cores shared it last.
  double within_scan_ms_ = 0.0;
  /// Scans since the last change, and how many it takes before the other parallelism is tried:
  /// twice as many each time that it was no better.
  int runs_ = 0;
  int patience_within_ = 0;
  int patience_across_ = min_patience;
};

}  // namespace stillmap::server
