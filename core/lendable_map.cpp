#include "core/lendable_map.hpp"

#include <algorithm>
#include <cassert>
#include <iterator>
#include <utility>
#include <vector>

#include "core/lidar/range_image_view.hpp"

namespace stillmap {

void PosedScan::correct(const MapCorrection& correction) {
  if (const auto* const T_new_old = correction.at(labelled.scan.stamp_ns))
    T_map_lidar = *T_new_old * T_map_lidar;
}

void insert_scan(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar,
                 const SensorModel& sensor, StaticMap& map) {
  if (!map.is_clearing()) return map.insert(labelled, T_map_lidar);
  std::vector<std::uint8_t> is_thin;
  RangeImageView view(labelled.scan, sensor, T_map_lidar, is_thin);
  map.insert(labelled, T_map_lidar, is_thin);
  const Clearing what = map.clearing_due(view.origin_map());
  map.clear_seen_through(std::move(view), labelled.scan.stamp_ns, what);
}

void LendableMap::insert(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar) {
  if (!is_lent_ && kept_.empty()) return insert_scan(labelled, T_map_lidar, *sensor_, map_);
  kept_.push_back({{labelled, T_map_lidar}, sensor_});
}

void LendableMap::let_wait(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar) {
  waiting_.add({{labelled, T_map_lidar}, sensor_}, T_map_lidar.translation(), labelled.scan.size());
}

std::size_t LendableMap::decide_waiting(MapEntry entry, bool later) {
  std::vector<Kept> entering = waiting_.decided_by(entry);
  std::ranges::move(entering, std::back_inserter(confirmed_));
  if (!later && !is_lent_) insert_confirmed();
  return entering.size();
}

StaticMap& LendableMap::lend() {
  assert(!is_lent_);
  is_lent_ = true;
  return map_;
}

void LendableMap::insert_some(std::deque<Kept>& scans, std::size_t max_scans) {
  assert(!is_lent_);
  for (; max_scans > 0 && !scans.empty(); --max_scans) {
    const Kept scan = std::move(scans.front());
    scans.pop_front();
    insert_scan(scan.posed.labelled, scan.posed.T_map_lidar, *scan.sensor, map_);
  }
}

void LendableMap::correct(const MapCorrection& correction) {
  for (auto* const scans : {&kept_, &confirmed_})
    for (Kept& scan : *scans) scan.posed.correct(correction);
  waiting_.for_each([&](Kept& scan) { scan.posed.correct(correction); });
}

StaticMap& LendableMap::map() {
  assert(!is_lent_);
  return map_;
}

}  // namespace stillmap
