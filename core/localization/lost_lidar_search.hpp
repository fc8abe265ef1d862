#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/lidar/shared_trajectory.hpp"
#include "core/localization/global_localization.hpp"
#include "core/localization/localizer.hpp"
#include "core/map/tile.hpp"
#include "core/odometry/odometry.hpp"
#include "core/odometry/odometry_state.hpp"

namespace stillmap {

/// Says when a lidar that its mapper cannot place is to be looked for in the whole map: mostly the
/// mapper finds it again by itself.
class LostWatch {
 public:
  /// Whether a scan's pose is known, and in the map.
  [[nodiscard]] static bool knows_place(const OdometryResult& odometry) {
    return odometry.health != OdometryHealth::lost && odometry.is_confirmed();
  }

  /// What became of the scan of this stamp. True where it stays lost, or nothing confirms its
  /// place, for some seconds, and at once where no scan was `placed` in the map (see
  /// Mapper::is_placed) yet.
  [[nodiscard]] bool is_due(std::int64_t stamp_ns, const OdometryResult& odometry, bool is_placed);
  void forget() { lost_since_ns_.reset(); }

 private:
  std::optional<std::int64_t> lost_since_ns_;
};

/// Looks for a lidar that its mapper has lost in the map that it makes, in the mapper's own thread:
/// for recordings, whose scans wait. So many searches a minute of the recording at most; the result
/// depends on the scans alone. A server does the same beside mapping.
class LostLidarSearch {
 public:
  /// The map as it is, with all voxels.
  using MapView = std::function<std::shared_ptr<const MapSnapshot>()>;

  LostLidarSearch(const OdometryConfig& odometry, const SensorModel& sensor,
                  const Eigen::Isometry3d& T_body_lidar, MapView map);

  /// Where an earlier run that the map is of, too, led: poses of the body.
  void add_path(const Trajectory& path);
  /// What became of the scan of this stamp: begins and ends searches.
  void update(std::int64_t stamp_ns, const OdometryResult& odometry, bool is_placed);
  /// Whether scans are looked for: follow() wants the next one.
  [[nodiscard]] bool is_on() const { return localization_.has_value(); }
  /// A scan of a search, prepared, with its times and rings, before it is registered. Throws what
  /// the map's tiles throw.
  void follow(const Scan& scan, const PointLabels& labels);
  /// Where it was found, once scans after that have confirmed it: ends the search.
  [[nodiscard]] std::optional<GlobalLocalization::Place> take_place();

 private:
  /// Makes the map searchable, unless it was lately.
  void index_map(std::int64_t stamp_ns);
  [[nodiscard]] bool is_due(std::int64_t stamp_ns) const;

  OdometryConfig odometry_;
  SensorModel sensor_;
  Eigen::Isometry3d T_body_lidar_;
  MapView map_;
  LostWatch watch_;
  /// Of the body, where the map may have its surroundings.
  SharedTrajectory path_;
  std::optional<Localizer> localizer_;
  std::int64_t indexed_ns_ = 0;
  std::uint64_t indexed_version_ = 0;
  /// Of the search that goes on.
  std::optional<GlobalLocalization> localization_;
  GlobalLocalization::Outcome outcome_ = GlobalLocalization::Outcome::nothing_new;
  std::int64_t searched_ns_ = 0;
  std::optional<GlobalLocalization::Place> found_;
};

}  // namespace stillmap
