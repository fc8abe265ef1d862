#pragma once

#include <cstdint>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/prepare.hpp"
#include "core/odometry/features.hpp"
#include "core/odometry/motion_classification.hpp"
#include "core/odometry/object_clusters.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// What registration uses of objects that could move.
enum class MovableUse {
  /// Nothing: an object that stood beside the lidar may set off with it.
  none,
  /// Those that earlier range images have shown parked.
  parked,
};

/// Points that registration and local map may use: with semantics none on objects that could move,
/// or (without earlier range images) those that pass eq. (9).
class UsablePoints {
 public:
  /// `objects` must outlive this.
  UsablePoints(const OdometryConfig& config, const ObjectClusters& objects,
               const std::vector<MotionClass>& motion_classes, MovableUse movable);

  [[nodiscard]] bool operator()(std::size_t i) const {
    const std::int32_t object = objects_.of_point[i];
    return object == ObjectClusters::none || usable_[static_cast<std::size_t>(object)];
  }
  [[nodiscard]] bool operator()(std::size_t i, Motion motion) const {
    return (*this)(i) && !(semantic_ && motion == Motion::highly_dynamic);
  }

 private:
  bool semantic_;
  const ObjectClusters& objects_;
  std::vector<bool> usable_;
};

/// Feature points of a scan that was moved to the middle of its sweep, with their labels.
class ScanFeatures {
 public:
  /// All must outlive this.
  ScanFeatures(const Scan& scan, const SweepTimes& sweep, const PointLabels& labels,
               const Features& features)
      : scan_(scan), sweep_(sweep), labels_(labels), features_(features) {}

  /// The usable points that are registered.
  [[nodiscard]] FeatureSets registered(const UsablePoints& usable) const;
  /// The usable points that enter the local map, without those that move. Edges and planes alone.
  [[nodiscard]] FeatureSets of_map(const UsablePoints& usable,
                                   const std::vector<Motion>& motion) const;

 private:
  [[nodiscard]] bool rolling() const { return sweep_.duration_s > 0.0; }
  [[nodiscard]] FeaturePoint point(std::uint32_t i) const;

  const Scan& scan_;
  const SweepTimes& sweep_;
  const PointLabels& labels_;
  const Features& features_;
};

/// Enough features to find a place by.
[[nodiscard]] FeatureSets downsampled(FeatureSets features);

/// Adds edges and planes to the map, compensated for `sweep_twist` beyond what they were, and
/// removes what is far from the lidar.
void extend_local_map(LocalMap& map, const FeatureSets& features,
                      const Eigen::Isometry3d& T_map_lidar,
                      const PoseTangent& sweep_twist = PoseTangent::Zero());

/// A map for the coarse registration that holds one scan alone.
[[nodiscard]] LocalMap coarse_map_of_scan(const FeatureSets& features,
                                          const Eigen::Isometry3d& T_map_lidar);

}  // namespace stillmap
