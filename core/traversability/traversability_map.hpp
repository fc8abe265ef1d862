#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/map/throttle_callback.hpp"
#include "core/map/tile.hpp"
#include "core/traversability/robot_profile.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Tiles that an update had to work on.
struct TraversabilityUpdate {
  /// Changed, new and removed tiles of the map.
  std::size_t map_tiles = 0;
  /// Tiles whose surface was computed anew: those and the ones that they reach into.
  std::size_t surfaces = 0;
  /// Tiles classified anew, all profiles together.
  std::size_t classified = 0;
};

/// The traversable area of a growing map, for several robots. The surface is computed once and
/// shared by all of them. An update works on the tiles that changed and on those that they
/// influence, and gives bit by bit what a new object would give for the same map. One thread
/// updates; views are immutable.
class TraversabilityMap {
 public:
  /// Throws std::invalid_argument naming the profile and its faults, or two profiles of one name.
  explicit TraversabilityMap(std::vector<RobotProfile> profiles);
  ~TraversabilityMap();
  TraversabilityMap(TraversabilityMap&&) noexcept;
  TraversabilityMap& operator=(TraversabilityMap&&) noexcept;

  /// Brings all profiles to this state of the map. Throws std::invalid_argument when the map's
  /// tiles are not whole numbers of voxels.
  TraversabilityUpdate update(const MapSnapshot& map, const ThrottleCallback& throttle = {});

  [[nodiscard]] const std::vector<RobotProfile>& profiles() const;
  /// The area of the profile as of the last update; null when there is no such profile.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(const std::string& profile) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
