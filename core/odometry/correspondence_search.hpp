#pragma once

#include <cstddef>
#include <span>

#include "core/odometry/registration.hpp"
#include "core/odometry/registration_limits.hpp"

namespace stillmap {

[[nodiscard]] std::size_t count_of(const FeatureSets& features);

/// Of edges, planes and surfaces, one after the other, with the scan at `pose`. `found` has one for
/// each; those that were looked up for a pose near this one keep their neighbours.
void find_all_correspondences(const FeatureSets& features, const LocalMap& map,
                              const OdometryResult& pose, const RegistrationLimits& config,
                              std::span<Correspondence> found);

}  // namespace stillmap
