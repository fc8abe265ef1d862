#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/range_image_view.hpp"
#include "core/odometry/object_clusters.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// What an earlier scan saw at the place of a point.
enum class PastObservation : std::uint8_t {
  /// Not observed: hidden, outside the field of view, no return.
  unknown,
  /// A surface was there.
  same,
  /// The ray went on behind it: nothing was there.
  free,
  /// A movable surface stood just before it, where the newest scan now sees through.
  removed_in_front,
};

/// Range images of the last scans, which tell whether the place of a point was free or occupied
/// then.
class RangeImageHistory {
 public:
  explicit RangeImageHistory(const MotionConfig& config) : config_(config) {}

  /// What the `age`-th kept view saw at a point of the newest scan, 0 the youngest. `now` is the
  /// view of the newest scan, which is not kept yet.
  [[nodiscard]] PastObservation observation(std::size_t age, const Eigen::Vector3f& point_map,
                                            const RangeImageView& now) const;

  /// Whether `view` measured something behind this place.
  [[nodiscard]] bool sees_through(const RangeImageView& view,
                                  const Eigen::Vector3f& point_map) const;

  /// Whether the oldest view that is kept saw a surface there that cannot move.
  [[nodiscard]] bool saw_fixed_at(const Eigen::Vector3f& point_map) const;

  void add(RangeImageView view);
  [[nodiscard]] bool is_empty() const { return views_.empty(); }
  /// Views that can be asked, at most `config.range_image_history_size`.
  [[nodiscard]] std::size_t size() const;
  /// How far a place is from that of the oldest view that is kept, where there are as many as may
  /// be; 0 else [m].
  [[nodiscard]] double distance_from_oldest_m(const Eigen::Vector3d& position_map) const;

 private:
  [[nodiscard]] float margin(float range_m) const;

  MotionConfig config_;
  /// Every scan since the oldest view that can be asked, newest last.
  std::deque<RangeImageView> views_;
};

/// What earlier range images say of an object.
enum class MotionClass : std::uint8_t {
  /// Not seen long enough to say.
  undecided,
  /// It stood here in the oldest kept view too.
  parked,
  /// It stands where there was nothing, or has left where it stood.
  moving,
};

/// One class an object. Undecided all when there are no earlier range images.
[[nodiscard]] std::vector<MotionClass> classify_motion(
    const Scan& scan, const ObjectClusters& objects, const Eigen::Isometry3d& T_map_lidar,
    const RangeImageHistory& history, const RangeImageView& now, const MotionConfig& config);

/// Motion of every point (paper II-C.2). Points of classes that cannot move are stationary;
/// movable ones are highly dynamic where earlier range images show their object moving, semi-static
/// otherwise. Without earlier range images eq. (9) decides: c > c_th against the local map, voted
/// by object. It is not used beside them, since it takes every parked car that comes into sight
/// over known road for a moving one (precision 0.36 instead of 0.94 in the simulated quiet city).
[[nodiscard]] std::vector<Motion> classify_point_motion(const Scan& scan, const PointLabels& labels,
                                                        const ObjectClusters& objects,
                                                        std::span<const MotionClass> motion_classes,
                                                        const Eigen::Isometry3d& T_map_lidar,
                                                        const LocalMap& map,
                                                        const OdometryConfig& config);

}  // namespace stillmap
