#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/prepare.hpp"
#include "core/lidar/range_image_view.hpp"
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
  /// All but those that earlier range images have shown moving.
  not_moving,
};

/// A scan that was moved to the middle of its sweep, while it is registered.
struct ScanInParts {
  const Scan& scan;
  const SweepTimes& sweep;
  const PointLabels& labels;
  Features features{};
  /// Enough of the features' surfaces where the prediction is good; empty where that is not known.
  std::vector<std::uint32_t> few_surfaces{};
  ObjectClusters objects{};
  std::optional<RangeImageView> view{};
  std::vector<MotionClass> motion_classes{};
  SweepPrior sweep_prior{};
  /// Registered by surfaces, though few points have neighbours on another ring: the rings are far
  /// apart, or the local map is young.
  bool sparse_rings = false;
  /// ring_tangents() of the scan for its upright points; empty where few of these could move, or
  /// rings are not known.
  std::vector<Eigen::Vector3f> upright_tangents{};
  /// At first that of the scan before.
  MovableUse movable = MovableUse::none;
  /// Farther off than this, rings lie farther apart than the neighbours that make a surface [m].
  float surfaces_reach_m = std::numeric_limits<float>::infinity();
};

/// Finds the upright tangents, where they are looked at.
void find_upright_tangents(ScanInParts& parts, const OdometryConfig& config);

/// The features that are registered: with semantics none on objects that could move, or (without
/// earlier range images) those that pass eq. (9). Takes parked objects, too, where few are left,
/// and all that were not seen moving where these are nearly all that stands up, or all of the
/// ground.
[[nodiscard]] FeatureSets registered_features(ScanInParts& parts, const OdometryConfig& config);

/// The same without objects that could move and are not parked.
[[nodiscard]] FeatureSets fixed_or_parked_features(ScanInParts& parts,
                                                   const OdometryConfig& config);

/// The same without any objects that could move, however little is left.
[[nodiscard]] FeatureSets fixed_features(const ScanInParts& parts, const OdometryConfig& config);

/// Which share of the points that stand up on objects that could move, and were not seen moving, is
/// on parked ones, 0..1.
[[nodiscard]] double parked_share(const ScanInParts& parts);

/// Those that enter the local map, without points that move. Edges, planes and points alone.
[[nodiscard]] FeatureSets map_features(const ScanInParts& parts, const std::vector<Motion>& motion,
                                       const OdometryConfig& config);

/// At most so many features of each kind, spread evenly: by default enough to find a place by, and
/// to tell which of several starts leads there.
[[nodiscard]] FeatureSets downsampled(FeatureSets features, std::size_t enough = 1000);

/// Adds edges and planes to the map, compensated for `motion` beyond what they were, and
/// removes what is far from the lidar.
void extend_local_map(LocalMap& map, const FeatureSets& features,
                      const Eigen::Isometry3d& T_map_lidar, const SweepCorrection& motion = {});

/// A map for the coarse registration that holds one scan alone.
[[nodiscard]] LocalMap coarse_map_of_scan(const FeatureSets& features,
                                          const Eigen::Isometry3d& T_map_lidar);

/// How many of the points that stand up could move by their labels.
[[nodiscard]] std::size_t movable_points(const FeatureSets& features);

/// Whether enough is left of the scan without what could move by its label.
[[nodiscard]] bool labels_tell_enough(const FeatureSets& features, const OdometryConfig& config);

}  // namespace stillmap
