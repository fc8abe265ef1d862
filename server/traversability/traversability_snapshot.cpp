#include "server/traversability/traversability_snapshot.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "core/map/voxel_grid.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap::server {
namespace {

std::string unknown_profile(const std::string& profile,
                            const TraversabilitySnapshot::Views& views) {
  if (views.empty())
    return "this server computes no traversability; its configuration's traversability.profiles is "
           "empty";
  std::string text =
      "profile '" + profile + "' is not one that this server computes traversability for: ";
  for (std::size_t i = 0; i < views.size(); ++i) {
    text += (i == 0 ? "" : ", ") + views[i]->profile.name;
  }
  return text + "; others have to be added to its configuration's traversability.profiles";
}

/// The tiles of the largest answer, and their neighbours.
constexpr std::size_t max_tiles = 400;

/// The tiles in the box, and the neighbours whose surface reaches into it.
MapSnapshot part_of(const MapSnapshot& map, const Eigen::AlignedBox2d& box_map) {
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(map.tile_size_m);
  const Eigen::AlignedBox2d wide(box_map.min() - margin, box_map.max() + margin);
  MapSnapshot part = map;
  std::erase_if(part.tiles, [&](const auto& tile) {
    const Eigen::AlignedBox3d footprint = tile_footprint(tile->info.id, map.tile_size_m);
    const Eigen::AlignedBox2d plan(Eigen::Vector2d(footprint.min().head<2>()),
                                   Eigen::Vector2d(footprint.max().head<2>()));
    return !wide.intersects(plan);
  });
  return part;
}

}  // namespace

void TraversabilitySnapshot::publish(Views views) {
  const std::scoped_lock lock(mutex_);
  views_ = std::move(views);
}

std::shared_ptr<const TraversabilityView> TraversabilitySnapshot::view(
    const std::string& profile) const {
  const std::scoped_lock lock(mutex_);
  const auto found = std::ranges::find_if(
      views_, [&](const auto& candidate) { return candidate->profile.name == profile; });
  if (found == views_.end()) throw std::invalid_argument(unknown_profile(profile, views_));
  return *found;
}

TraversabilityCache::TraversabilityCache(const TraversabilitySnapshot& snapshot,
                                         const LatestMap& latest_map, TileReader& tiles)
    : snapshot_(snapshot), latest_map_(latest_map), tiles_(tiles) {}

std::shared_ptr<const TraversabilityView> TraversabilityCache::view(
    const std::string& profile, const Eigen::AlignedBox2d& box_map) const {
  const auto kept = snapshot_.view(profile);
  const auto map = latest_map_.view();
  const auto non_resident = [](const auto& tile) { return is_non_resident(*tile); };
  if (std::ranges::none_of(map->tiles, non_resident)) return kept;
  MapSnapshot part = part_of(*map, box_map);
  if (std::ranges::none_of(part.tiles, non_resident)) return kept;
  if (part.tiles.size() > max_tiles) {
    throw std::invalid_argument("the region has " + std::to_string(part.tiles.size()) +
                                " tiles, of which some are on disk; at most " +
                                std::to_string(max_tiles) + " can be answered: ask for parts");
  }
  for (auto& tile : part.tiles) tile = tiles_.read(tile);
  TraversabilityMap computed({kept->profile});
  static_cast<void>(computed.update(part));
  return computed.view(profile);
}

}  // namespace stillmap::server
