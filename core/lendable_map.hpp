#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <deque>
#include <limits>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/map/map_correction.hpp"
#include "core/map/static_map.hpp"

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
      : map_(config), sensor_(sensor) {}

  void insert(const LabelledScan& labelled, const Eigen::Isometry3d& T_map_lidar);

  /// Until reclaim().
  [[nodiscard]] StaticMap& lend();
  void reclaim() { is_lent_ = false; }
  [[nodiscard]] bool is_lent() const { return is_lent_; }
  /// Scans that wait to enter the map.
  [[nodiscard]] std::size_t kept_scans() const { return kept_.size(); }
  /// The oldest of them enter the map, which must not be lent. One that cannot is gone.
  void insert_kept(std::size_t max_scans = std::numeric_limits<std::size_t>::max());
  /// Moves the scans that are kept.
  void correct(const MapCorrection& correction);
  void forget_kept() { kept_.clear(); }

  /// Must not be lent.
  [[nodiscard]] StaticMap& map();
  /// Null while it is lent.
  [[nodiscard]] const StaticMap* readable() const { return is_lent_ ? nullptr : &map_; }

 private:
  StaticMap map_;
  SensorModel sensor_;
  bool is_lent_ = false;
  std::deque<PosedScan> kept_;
};

}  // namespace stillmap
