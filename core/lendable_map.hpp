#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <deque>
#include <limits>
#include <memory>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/static_map.hpp"
#include "core/odometry/odometry_state.hpp"
#include "core/waiting_scans.hpp"

namespace stillmap {

/// A scan and where its lidar was.
struct PosedScan {
  LabelledScan labelled;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();

  /// Its pose was wrong by that.
  void correct(const MapCorrection& correction);
};

/// Adds what the scan hit to `map`, and clears what it saw through when that is due.
void insert_scan(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar,
                 const SensorModel& sensor, StaticMap& map);

/// The static map of a mapper, which can be lent to another thread. Meanwhile nothing here touches
/// it, and scans that would enter it are kept, as are those that come before all of them were
/// inserted afterwards: scans enter it in their order. NOT thread safe.
class LendableMap {
 public:
  LendableMap(const StaticMapConfig& config, const SensorModel& sensor)
      : map_(config), sensor_(std::make_shared<const SensorModel>(sensor)) {}

  void insert(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar);
  /// Of the next scans; those that are kept or wait are of the one before.
  void use_sensor(const SensorModel& sensor) {
    sensor_ = std::make_shared<const SensorModel>(sensor);
  }
  /// A scan of MapEntry::waits.
  void let_wait(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar);
  /// What becomes of those by the entry of the next scan, before that is inserted: they are
  /// inserted now, or, where the map is lent or that is said, later by insert_confirmed(). Returns
  /// how many.
  std::size_t decide_waiting(MapEntry entry, bool later);
  [[nodiscard]] std::size_t confirmed_scans() const { return confirmed_.size(); }
  /// The oldest of them enter the map, which must not be lent; not in the order of all scans.
  void insert_confirmed(std::size_t max_scans = std::numeric_limits<std::size_t>::max()) {
    insert_some(confirmed_, max_scans);
  }

  /// Until reclaim().
  [[nodiscard]] StaticMap& lend();
  void reclaim() { is_lent_ = false; }
  [[nodiscard]] bool is_lent() const { return is_lent_; }
  /// Scans that wait to enter the map.
  [[nodiscard]] std::size_t kept_scans() const { return kept_.size(); }
  /// The oldest of them enter the map, which must not be lent. One that cannot is gone.
  void insert_kept(std::size_t max_scans = std::numeric_limits<std::size_t>::max()) {
    insert_some(kept_, max_scans);
  }
  /// Moves the scans that are not in the map yet.
  void correct(const MapCorrection& correction);
  void forget_kept() {
    kept_.clear();
    confirmed_.clear();
    waiting_.clear();
  }

  /// Must not be lent.
  [[nodiscard]] StaticMap& map();
  /// Null while it is lent.
  [[nodiscard]] const StaticMap* readable() const { return is_lent_ ? nullptr : &map_; }

 private:
  /// A scan, and the lidar that it is of.
  struct Kept {
    PosedScan posed;
    std::shared_ptr<const SensorModel> sensor;
  };
  void insert_some(std::deque<Kept>& scans, std::size_t max_scans);

  StaticMap map_;
  std::shared_ptr<const SensorModel> sensor_;
  bool is_lent_ = false;
  std::deque<Kept> kept_;
  std::deque<Kept> confirmed_;
  WaitingScans<Kept> waiting_;
};

}  // namespace stillmap
