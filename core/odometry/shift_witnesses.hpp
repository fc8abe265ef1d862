#pragma once

#include <Eigen/Core>

#include "core/odometry/registration.hpp"

namespace stillmap {

/// What a shift of one metre along `shift_map`, of length 1 along the map's axes, takes along of
/// the other directions of a pose, as its covariance says.
[[nodiscard]] PoseTangent likely_shift(const OdometryResult& found,
                                       const Eigen::Vector3d& shift_map);

/// Whether a scan shows a shift by what few of its features there are that see it: whether these,
/// each by how squarely its surface stands across the shift, lie clearly worse 0.6 m to either
/// side. Poles, kerbs and parked cars on open land do, however much ground there is round them. The
/// noise of normals along smooth walls, or planes through crops that lean every way, see a shift,
/// too, but lie as well beside. `shift` moves by one metre, and may turn.
[[nodiscard]] bool witnesses_tell(const PoseTangent& shift, const FeatureSets& features,
                                  const LocalMap& map, const OdometryResult& found,
                                  const OdometryConfig& config);

}  // namespace stillmap
