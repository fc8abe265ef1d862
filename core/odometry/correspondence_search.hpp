#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <span>

#include "core/odometry/registration.hpp"
#include "core/odometry/registration_limits.hpp"

namespace stillmap {

/// A feature of a scan and the surface of the local map that it should lie on.
struct Correspondence {
  Eigen::Vector3d point_lidar;
  FittedSurface surface;
  double inconsistency = 0.0;
  double sweep_part = 0.0;
  /// What a plane counts by how thin it is, 0..1.
  double thinness = 1.0;
  bool found = false;
  bool in_known_space = false;
  /// Where the neighbours were looked up; NaN: not yet.
  Eigen::Vector3f searched_map = Eigen::Vector3f::Constant(std::numeric_limits<float>::quiet_NaN());
};

[[nodiscard]] std::size_t count_of(const FeatureSets& features);

/// Of edges, planes and surfaces, one after the other, with the scan at `pose`. `found` has one for
/// each; those that were looked up for a pose near this one keep their neighbours.
void find_all_correspondences(const FeatureSets& features, const LocalMap& map,
                              const OdometryResult& pose, const RegistrationLimits& config,
                              std::span<Correspondence> found);

}  // namespace stillmap
