#include "core/graph/live_loop_closer.hpp"

#include <algorithm>
#include <utility>

namespace stillmap {

std::string LiveLoopCloser::add(const GnssFix& fix) {
  const std::size_t origins = gnss_.origins();
  std::string refusal = gnss_.add(fix);
  if (gnss_.origins() != origins) closer_.replace_positions({});
  return refusal;
}

std::optional<MapCorrection> LiveLoopCloser::add(const LabelledScan& scan,
                                                 const Eigen::Isometry3d& T_odom_lidar,
                                                 bool is_confirmed,
                                                 const Eigen::Vector3d& antenna_lidar) {
  if (!end_reason_.empty()) return std::nullopt;
  const std::int64_t stamp_ns = scan.scan.stamp_ns;
  if (stamp_ns <= std::exchange(last_stamp_ns_, stamp_ns)) {
    // Voxels name the times at which they were seen, and these are two times now.
    end("the clock of the scans was set back");
    return std::nullopt;
  }
  if (!has_moved(T_odom_lidar)) return std::nullopt;
  const bool is_replaced = gnss_.judge_delay();
  if (is_replaced) closer_.replace_positions(gnss_.take());
  stamps_ns_.push_back(stamp_ns);
  T_odom_lidar_last_ = T_odom_lidar;
  T_map_lidar_.push_back(T_map_odom_ * T_odom_lidar);
  if (is_confirmed) {
    gnss_.add_scan(stamps_ns_.size() - 1, stamp_ns, T_odom_lidar, antenna_lidar);
  }
  closer_.add(scan, T_odom_lidar, is_confirmed);
  for (const PositionAtScan& position : gnss_.take()) closer_.add(position);
  if (closer_.submaps().size() == known_submaps_ && !is_replaced) return std::nullopt;
  known_submaps_ = closer_.submaps().size();
  auto found = correction();
  if (closer_.submap_bytes() > config_.max_submap_bytes) {
    end("what is kept of the drive to find loops by has reached its limit");
    has_dropped_submaps_ = true;
  }
  return found;
}

bool LiveLoopCloser::is_full() const {
  if (has_dropped_submaps_) return true;
  return end_reason_.empty() && is_in_earlier_map_ && closer_.nodes().size() > config_.max_nodes &&
         closer_.is_newest_submap_joined();
}

std::optional<MapOnEarth> LiveLoopCloser::on_earth() const {
  const auto& T_enu_map = closer_.T_enu_map();
  if (!T_enu_map) return std::nullopt;
  return MapOnEarth{gnss_.enu()->datum_of(*T_enu_map), gnss_.enu()->T_earth(*T_enu_map)};
}

SubmapList LiveLoopCloser::submaps() const {
  if (!end_reason_.empty()) return last_submaps_;
  SubmapList list{.graph_revision = corrections_, .submaps = {}, .loops = {}};
  for (const PlacedSubmap& placed : closer_.submaps()) {
    const LoopCloser::Node& key = closer_.nodes()[placed.submap.key_node];
    list.submaps.push_back({stamps_ns_[key.scan], key.way_m, T_map_lidar_[key.scan]});
  }
  for (std::size_t i = 0; i < closer_.joints().size(); ++i) {
    const LoopCloser::Joint& joint = closer_.joints()[i];
    const LoopClosure& closure = closer_.closures()[i];
    list.loops.push_back({.from = joint.from,
                          .to = joint.to,
                          .T_from_to = closure.T_from_to,
                          .overlap = closure.overlap,
                          .upright_fit = closure.upright_fit,
                          .jump_m = closure.jump_m});
  }
  return list;
}

bool LiveLoopCloser::has_moved(const Eigen::Isometry3d& T_odom_lidar) const {
  if (stamps_ns_.empty()) return true;
  const Eigen::Isometry3d motion = T_odom_lidar_last_.inverse() * T_odom_lidar;
  return motion.translation().norm() >= config_.scan_spacing_m ||
         Eigen::AngleAxisd(motion.linear()).angle() >= config_.scan_turn_rad;
}

void LiveLoopCloser::end(const char* reason) {
  last_submaps_ = submaps();
  end_reason_ = reason;
  closer_ = LoopCloser(config_.closing);
  stamps_ns_ = {};
  T_map_lidar_ = {};
}

std::optional<MapCorrection> LiveLoopCloser::correction() {
  // Without any, also where the last one was denied, poses are the odometry's.
  if (!closer_.is_corrected() && !was_corrected_) return std::nullopt;
  const std::vector<Eigen::Isometry3d> corrected = closer_.corrected_poses();
  std::vector<MapCorrection::Pose> poses(corrected.size());
  double max_shift_m = 0.0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i] = {stamps_ns_[i], T_map_lidar_[i].translation(),
                corrected[i] * T_map_lidar_[i].inverse()};
    const double shift_m = MapCorrection::max_shift_m(poses[i], config_.range_m);
    max_shift_m = std::max(max_shift_m, shift_m);
    // What was seen from there stays where it is: the pose, too, until both move.
    if (shift_m < config_.min_shift_m) poses[i].T_new_old = Eigen::Isometry3d::Identity();
  }
  if (max_shift_m < config_.min_shift_m) return std::nullopt;
  was_corrected_ = closer_.is_corrected();
  for (std::size_t i = 0; i < poses.size(); ++i)
    T_map_lidar_[i] = poses[i].T_new_old * T_map_lidar_[i];
  ++corrections_;
  MapCorrection correction(std::move(poses));
  T_map_odom_ = correction.latest() * T_map_odom_;
  return correction;
}

}  // namespace stillmap
