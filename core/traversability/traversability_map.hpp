#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/map/query/tile_reader.hpp"
#include "core/map/throttle_callback.hpp"
#include "core/map/tile.hpp"
#include "core/traversability/robot_profile.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Number of tiles that an update processed.
struct TraversabilityUpdate {
  /// Changed, new and removed tiles of the map.
  std::size_t map_tiles = 0;
  /// Tiles that could not be read, and stay as they were.
  std::size_t unread_tiles = 0;
  /// Tiles whose surface was recomputed: changed tiles and the neighbours that they influence.
  std::size_t surfaces = 0;
  /// Tiles that were reclassified, summed over all profiles.
  std::size_t classified = 0;
};

/// Why a robot cannot be classified in tiles of so many metres: what is lethal in a tile reaches
/// into those beside it, and no farther. Empty where it can.
[[nodiscard]] std::string tile_size_fault(const RobotProfile& profile, double tile_size_m);

/// Traversability of a growing map for several robots, which share the surface. An update processes
/// the tiles that changed and those that they influence; its result is bitwise that of a new object
/// for the same map. NOT thread-safe; views are immutable.
class TraversabilityMap {
 public:
  /// Throws std::invalid_argument naming the profile and its faults, or two profiles of one name.
  explicit TraversabilityMap(std::vector<RobotProfile> profiles);
  ~TraversabilityMap();
  TraversabilityMap(TraversabilityMap&&) noexcept;
  TraversabilityMap& operator=(TraversabilityMap&&) noexcept;

  /// Updates all profiles to this snapshot. Non-resident tiles that changed are read through
  /// `tiles`, without which there must be none; one that cannot be read stays as it was, and is
  /// tried again by the next update. Throws std::invalid_argument if a tile's side is not a whole
  /// number of voxels, and with tile_size_fault.
  TraversabilityUpdate update(const MapSnapshot& map, const ThrottleCallback& throttle = {},
                              TileReader* tiles = nullptr);

  [[nodiscard]] const std::vector<RobotProfile>& profiles() const;
  /// View of a profile at the last update; null if there is no such profile.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(const std::string& profile) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
