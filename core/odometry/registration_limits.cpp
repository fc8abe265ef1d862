#include "core/odometry/registration_limits.hpp"

namespace stillmap {
namespace {

/// A lidar looks one way where less than this of what it sees has something opposite.
constexpr double min_balance = 0.5;

}  // namespace

RegistrationLimits limits_for(const FeatureSets& features, const RegistrationConfig& config) {
  RegistrationLimits limits{config};
  if (features.sparse_rings) {
    limits.neighbours = limits.sparse_ring_neighbours;
    limits.min_plane_width = limits.sparse_ring_plane_width;
    limits.plane_deviation_m = limits.sparse_ring_plane_deviation_m;
    limits.across_rings_weight = 0.0;
    return limits;
  }
  // Lines along rings, and planes that lean over them, go along with the lidar: those behind it
  // hold its pitch against those ahead.
  limits.has_wide_planes = features.balance < min_balance;
  if (limits.has_wide_planes && limits.across_rings_weight < 1.0)
    limits.across_rings_weight *= features.balance / min_balance;
  return limits;
}

}  // namespace stillmap
