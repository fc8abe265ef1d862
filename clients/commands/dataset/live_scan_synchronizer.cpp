#include "clients/commands/dataset/live_scan_synchronizer.hpp"

#include <iterator>
#include <utility>

namespace stillmap::cli {

void LiveScanSynchronizer::add_scan(const Scan& scan) {
  waiting_.push_back(scan);
  if (waiting_.size() <= max_waiting) return;
  waiting_.pop_front();
  ++without_pose_;
}

void LiveScanSynchronizer::add_pose(const StampedPose& pose) {
  T_map_lidar_.insert_or_assign(pose.stamp_ns, pose.T_map_lidar);
  if (T_map_lidar_.size() > 2 * max_waiting) T_map_lidar_.erase(T_map_lidar_.begin());
}

void LiveScanSynchronizer::add_labels(std::int64_t stamp_ns, std::vector<SemanticClass> classes) {
  classes_.insert_or_assign(stamp_ns, std::move(classes));
  if (classes_.size() > max_waiting) classes_.erase(classes_.begin());
}

std::optional<LiveScan> LiveScanSynchronizer::take() { return take_if(false); }

std::optional<LiveScan> LiveScanSynchronizer::take_last() { return take_if(true); }

std::optional<LiveScan> LiveScanSynchronizer::take_if(bool all_arrived) {
  while (!waiting_.empty()) {
    const std::int64_t stamp_ns = waiting_.front().stamp_ns;
    const auto pose = T_map_lidar_.find(stamp_ns);
    const auto later = T_map_lidar_.upper_bound(stamp_ns);
    if (pose == T_map_lidar_.end()) {
      if (later == T_map_lidar_.end() && !all_arrived) return std::nullopt;
      waiting_.pop_front();
      ++without_pose_;
      continue;
    }
    const auto labels = classes_.find(stamp_ns);
    const auto later_poses = static_cast<std::size_t>(std::distance(later, T_map_lidar_.end()));
    if (labels == classes_.end() && later_poses < max_label_delay_scans && !all_arrived) {
      return std::nullopt;
    }
    LiveScan live{
        .scan = std::move(waiting_.front()), .T_map_lidar = pose->second, .classes = std::nullopt};
    if (labels != classes_.end()) live.classes = std::move(labels->second);
    waiting_.pop_front();
    return live;
  }
  return std::nullopt;
}

}  // namespace stillmap::cli
