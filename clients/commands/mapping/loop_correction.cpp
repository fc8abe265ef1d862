#include "clients/commands/mapping/loop_correction.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "core/dataset/dataset_error.hpp"
#include "core/lendable_map.hpp"

namespace stillmap::cli {
namespace {

/// Adds the time that it lives to a sum of seconds.
class Timed {
 public:
  explicit Timed(double& seconds) : seconds_(seconds), began_(std::chrono::steady_clock::now()) {}
  ~Timed() {
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
  }
  Timed(const Timed&) = delete;
  Timed& operator=(const Timed&) = delete;

 private:
  double& seconds_;
  std::chrono::steady_clock::time_point began_;
};

/// By so much more than stamps may be off fixes are looked for before the first scan and after the
/// last one [s].
constexpr double beyond_scans_s = 5.0;
constexpr double bytes_per_mib = 1024.0 * 1024.0;

}  // namespace

LoopCorrection::LoopCorrection(LoopOptions options, const SensorModel& sensor)
    : fixes_(std::move(options.gnss.fixes)),
      antenna_lidar_(options.gnss.antenna_lidar),
      reach_ns_(std::llround(1e9 * (beyond_scans_s + std::abs(options.gnss.config.delay_s.value_or(
                                                         GnssDelayConfig{}.max_delay_s))))),
      gnss_(options.gnss.config),
      sensor_(sensor),
      scans_file_(options.scans_file),
      log_(options.scans_file, options.max_range_m),
      closer_(LoopClosingConfig{}) {
  std::ranges::stable_sort(fixes_, {}, &GnssFix::stamp_ns);
  for (const DeniedLoop& denied : options.denied) closer_.deny(denied);
}

void LoopCorrection::resume(std::size_t next_scan, std::size_t poses) {
  const Timed timed(seconds_);
  log_.truncate_from(next_scan);
  if (log_.size() < poses) {
    throw DatasetError(
        scans_file_,
        "holds " + std::to_string(log_.size()) + " of the " + std::to_string(poses) +
            " scans that were mapped until the run was stopped (power lost, a damaged disk, or "
            "another version of Stillmap); begin anew with --force");
  }
  log_.read([this](const LoggedScan& scan) { add(scan); });
}

void LoopCorrection::add(std::size_t index, const MappedScan& mapped) {
  const Timed timed(seconds_);
  const LoggedScan scan{.index = index,
                        .T_odom_lidar = mapped.odometry.T_map_lidar,
                        .entry = mapped.odometry.map_entry,
                        .begins_elsewhere = mapped.begins_elsewhere,
                        .labelled = mapped.labelled};
  log_.append(scan);
  add(scan);
}

void LoopCorrection::add(const LoggedScan& scan) {
  index_.push_back(scan.index);
  T_odom_lidar_.push_back(scan.T_odom_lidar);
  const bool waits = scan.entry == MapEntry::waits;
  if (waits || (scan.entry == MapEntry::stays_out && !may_enter_.empty())) {
    may_enter_.push_back(waits);
    return;
  }
  close_waiting(scan.entry);
  if (scan.begins_elsewhere) closer_.go_on_elsewhere();
  close(index_.size() - 1, scan.labelled, is_confirmed(scan.entry));
}

void LoopCorrection::close_waiting(MapEntry entry) {
  for (const bool may_enter : std::exchange(may_enter_, {})) {
    const std::size_t place = enters_.size();
    close(place, log_.at(place).labelled, may_enter && entry == MapEntry::enters_with_waiting);
  }
}

void LoopCorrection::close(std::size_t place, const LabelledScan& scan, bool enters) {
  enters_.push_back(enters);
  const std::int64_t stamp_ns = scan.scan.stamp_ns;
  const Eigen::Isometry3d& T_odom_lidar = T_odom_lidar_[place];
  if (place == 0) skip_fixes(stamp_ns - reach_ns_);
  last_stamp_ns_ = stamp_ns;
  if (gnss_.judge_delay()) closer_.replace_positions(gnss_.take());
  closer_.add(scan, T_odom_lidar, enters, index_[place]);
  add_fixes(stamp_ns);
  if (!enters) return;
  gnss_.add_scan(place, stamp_ns, T_odom_lidar, antenna_lidar_);
  for (const PositionAtScan& position : gnss_.take()) closer_.add(position);
}

void LoopCorrection::skip_fixes(std::int64_t until_ns) {
  while (next_fix_ < fixes_.size() && fixes_[next_fix_].stamp_ns < until_ns) ++next_fix_;
}

void LoopCorrection::add_fixes(std::int64_t until_ns) {
  for (; next_fix_ < fixes_.size() && fixes_[next_fix_].stamp_ns <= until_ns; ++next_fix_) {
    const std::size_t origins = gnss_.origins();
    const std::string refusal = gnss_.add(fixes_[next_fix_]);
    if (gnss_.origins() != origins) closer_.replace_positions({});
    if (refusal.empty()) continue;
    if (refused_fixes_++ == 0) refusal_ = refusal;
  }
}

bool LoopCorrection::finish() {
  const Timed timed(seconds_);
  close_waiting(MapEntry::stays_out_with_waiting);
  // Stamps may be late: the last ones belong to scans before them. What comes after them is of
  // another part of the drive, which is not mapped.
  if (!enters_.empty()) add_fixes(last_stamp_ns_ + reach_ns_);
  if (gnss_.judge_delay(true)) closer_.replace_positions(gnss_.take());
  for (const PositionAtScan& position : gnss_.take()) closer_.add(position);
  closer_.finish();
  T_map_lidar_ = closer_.corrected_poses();
  return closer_.is_corrected();
}

MapAlignment LoopCorrection::align(const std::shared_ptr<const PlaceIndex>& map,
                                   const Eigen::Matrix3d& R_body_lidar) {
  const auto scan_at = [this](std::size_t scan) { return log_.at(scan).labelled; };
  MapAlignment alignment = MapAligner(map).align(closer_, scan_at, R_body_lidar);
  for (std::vector<MapClosure>* const list : {&alignment.closures, &alignment.refused})
    for (MapClosure& closure : *list) closure.scan = index_.at(closure.scan);
  return alignment;
}

bool LoopCorrection::insert_into(StaticMap& map, const std::vector<Eigen::Isometry3d>& T_map_lidar,
                                 std::int64_t clock_offset_ns,
                                 const std::function<bool(std::size_t done)>& scan_done) {
  const Timed timed(seconds_);
  for (std::size_t i = 0; i < T_map_lidar.size(); ++i) {
    LoggedScan scan = log_.at(i);
    scan.labelled.scan.stamp_ns += clock_offset_ns;
    if (enters_[i]) insert_scan(scan.labelled, T_map_lidar[i], sensor_, map);
    if (!scan_done(i + 1)) return false;
  }
  return true;
}

GnssReport LoopCorrection::gnss_report() const {
  GnssReport report{.fixes = fixes_.size(),
                    .refusal = refusal_,
                    .refused = refused_fixes_,
                    .placed = gnss_.placed(),
                    .positions = closer_.position_counts(),
                    .are_refused = closer_.are_positions_refused(),
                    .delay = gnss_.delay(),
                    .datum = std::nullopt};
  if (const auto& T_enu_map = closer_.T_enu_map()) {
    report.datum = gnss_.enu()->datum_of(*T_enu_map);
    report.tilt_rad = std::acos(std::clamp(T_enu_map->linear()(2, 2), -1.0, 1.0));
  }
  return report;
}

LoopReport LoopCorrection::report() const {
  LoopReport report{.closures = closer_.closures(),
                    .refused = closer_.refused(),
                    .submaps = closer_.submaps().size(),
                    .nodes = closer_.graph().T_map_node.size(),
                    .submap_mib = static_cast<double>(closer_.submap_bytes()) / bytes_per_mib,
                    .scan_log_mib = static_cast<double>(log_.bytes()) / bytes_per_mib,
                    .max_correction_m = 0.0,
                    .seconds = seconds_,
                    .gnss = std::nullopt};
  if (!fixes_.empty()) report.gnss = gnss_report();
  for (std::vector<LoopClosure>* const list : {&report.closures, &report.refused}) {
    for (LoopClosure& closure : *list) {
      closure.from_scan = index_.at(closure.from_scan);
      closure.to_scan = index_.at(closure.to_scan);
    }
  }
  for (std::size_t i = 0; i < T_map_lidar_.size(); ++i) {
    const double moved_m = (T_map_lidar_[i].translation() - T_odom_lidar_[i].translation()).norm();
    report.max_correction_m = std::max(report.max_correction_m, moved_m);
  }
  return report;
}

}  // namespace stillmap::cli
