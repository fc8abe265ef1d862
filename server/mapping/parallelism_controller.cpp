#include "server/mapping/parallelism_controller.hpp"

#include <algorithm>

namespace stillmap::server {

void ParallelismController::add_measurement(Parallelism parallelism, double coarsest_ms,
                                            double room_ms) {
  // Not of a scan that was begun before the last change.
  if (parallelism != parallelism_ || concurrent_scans_ < 2) return;
  coarsest_ms_.add(coarsest_ms);
  runs_ = std::min(runs_ + 1, max_patience);
  if (!is_settled() || room_ms <= 0.0) return;
  if (parallelism_ == Parallelism::within_scan) {
    within_scan_ms_ = coarsest_ms_.value();
    if (within_scan_ms_ <= late_share * room_ms || runs_ < patience_within_) return;
    // Soon after the last change it was a trial that failed.
    patience_across_ =
        runs_ < min_patience ? std::min(2 * patience_across_, max_patience) : min_patience;
    change_to(Parallelism::across_scans);
  } else if (coarsest_ms_.value() >
             better_share * within_scan_ms_ * static_cast<double>(concurrent_scans_)) {
    patience_within_ = std::min(std::max(2 * patience_within_, min_patience), max_patience);
    change_to(Parallelism::within_scan);
  } else if (runs_ >= patience_across_) {
    patience_within_ = 0;
    change_to(Parallelism::within_scan);
  }
}

void ParallelismController::change_to(Parallelism parallelism) {
  parallelism_ = parallelism;
  coarsest_ms_ = RecentMedian(median_window);
  runs_ = 0;
}

}  // namespace stillmap::server
