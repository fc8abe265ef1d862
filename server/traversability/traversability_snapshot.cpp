#include "server/traversability/traversability_snapshot.hpp"

#include <algorithm>
#include <map>
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

/// More tiles than any window has.
constexpr std::size_t max_window_tiles = 10'000;

/// Sorted by id, the tiles in the boxes, and the neighbours whose surface reaches into them; no
/// more than tell that they are too many.
std::vector<std::shared_ptr<const Tile>> tiles_round(
    const MapSnapshot& map, std::span<const Eigen::AlignedBox2d> boxes_map) {
  const Eigen::Vector3d margin(map.tile_size_m, map.tile_size_m, 0.0);
  std::map<TileId, std::shared_ptr<const Tile>> tiles;
  for (const Eigen::AlignedBox2d& box : boxes_map) {
    const Eigen::Vector3d low(box.min().x(), box.min().y(), 0.0);
    const Eigen::Vector3d high(box.max().x(), box.max().y(), 0.0);
    const TileRange range = tile_range({low - margin, high + margin}, map.tile_size_m);
    for (auto& tile : tiles_in_range(map.tiles, range, max_window_tiles + 1)) {
      const TileId id = tile->info.id;
      tiles.emplace(id, std::move(tile));
    }
    if (tiles.size() > max_window_tiles) break;
  }
  std::vector<std::shared_ptr<const Tile>> sorted;
  sorted.reserve(tiles.size());
  for (auto& [id, tile] : tiles) sorted.push_back(std::move(tile));
  return sorted;
}

}  // namespace

void TraversabilitySnapshot::publish(Views views, MapInWindow of) {
  const std::scoped_lock lock(mutex_);
  views_ = std::move(views);
  of_ = std::move(of);
}

bool TraversabilitySnapshot::Known::has(const Tile& tile) const {
  const TileId id = tile.info.id;
  if (is_non_resident(tile) || id.x < window.first.x || id.x > window.last.x ||
      id.y < window.first.y || id.y > window.last.y)
    return false;
  const auto then = map ? map->tiles.find(id) : nullptr;
  return then == nullptr || !is_non_resident(*then);
}

TraversabilitySnapshot::Known TraversabilitySnapshot::known(const std::string& profile) const {
  const std::scoped_lock lock(mutex_);
  const auto found = std::ranges::find_if(
      views_, [&](const auto& candidate) { return candidate->profile.name == profile; });
  if (found == views_.end()) throw std::invalid_argument(unknown_profile(profile, views_));
  return {of_, *found};
}

TraversabilityCache::TraversabilityCache(const TraversabilitySnapshot& snapshot,
                                         const LatestMap& latest_map, TileReader& tiles,
                                         std::chrono::milliseconds longest_lag)
    : snapshot_(snapshot), latest_map_(latest_map), tiles_(tiles), longest_lag_(longest_lag) {}

std::chrono::milliseconds TraversabilityCache::longest_lag(
    std::chrono::duration<double> update_period) {
  return std::chrono::seconds(2) +
         std::chrono::duration_cast<std::chrono::milliseconds>(update_period);
}

bool TraversabilityCache::Computed::is_of(
    const std::string& profile, std::uint64_t id,
    std::span<const std::shared_ptr<const Tile>> others) const {
  return view && view->profile.name == profile && map_id == id &&
         std::ranges::equal(tiles, others,
                            [](const auto& kept, const auto& tile) { return kept.lock() == tile; });
}

bool TraversabilityCache::is_behind(const TraversabilitySnapshot::Known& kept, MapTime map_time,
                                    std::span<const std::shared_ptr<const Tile>> tiles,
                                    std::span<const Eigen::AlignedBox2d> boxes_map) const {
  if (!kept.map_time || map_time - *kept.map_time <= longest_lag_) return false;
  return !std::ranges::equal(tiles_round(*kept.map, boxes_map), tiles);
}

std::shared_ptr<const TraversabilityView> TraversabilityCache::view(
    const std::string& profile, std::span<const Eigen::AlignedBox2d> boxes_map) const {
  const TraversabilitySnapshot::Known kept = snapshot_.known(profile);
  const auto [map, map_time] = *latest_map_.wait_for_update(nullptr, {}, {});
  auto tiles = tiles_round(*map, boxes_map);
  // After a load or a reset what is kept is of the last map for a while.
  const bool is_of_map = kept.map == nullptr || kept.map->map_id == map->map_id;
  // After a correction it holds only where that moved nothing.
  const bool is_where_it_was = kept.map == nullptr ||
                               kept.corrections == latest_map_.corrections() ||
                               tiles_round(*kept.map, boxes_map) == tiles;
  const bool has_all =
      is_of_map && is_where_it_was &&
      std::ranges::all_of(tiles, [&](const auto& tile) { return kept.has(*tile); });
  const bool is_small = tiles.size() <= max_tiles;
  if (has_all && !(is_small && is_behind(kept, map_time, tiles, boxes_map))) return kept.view;
  if (!is_small) {
    throw std::invalid_argument("the region has " + std::to_string(tiles.size()) +
                                " tiles or more, of which some are on disk, far from the robot or "
                                "just corrected; at most " +
                                std::to_string(max_tiles) + " can be answered: ask for parts");
  }
  {
    const std::scoped_lock lock(mutex_);
    if (computed_.is_of(profile, map->map_id, tiles)) return computed_.view;
  }
  const std::vector<std::weak_ptr<const Tile>> of_map(tiles.begin(), tiles.end());
  for (auto& tile : tiles) tile = tiles_.read(tile);
  MapSnapshot part = *map;
  part.tiles = TileTable(std::move(tiles));
  TraversabilityMap computed({kept.view->profile});
  static_cast<void>(computed.update(part));
  auto view = computed.view(profile);
  const std::scoped_lock lock(mutex_);
  computed_ = {.map_id = map->map_id, .tiles = of_map, .view = view};
  return view;
}

}  // namespace stillmap::server
