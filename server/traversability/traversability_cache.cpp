#include "server/traversability/traversability_cache.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/map/tile_lookup.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap {
namespace {

/// As many as the largest answer has, and those round them.
constexpr std::size_t most_tiles = 400;

/// With the neighbours whose surface reaches into the box.
MapView part_of(const MapView& map, const Eigen::AlignedBox2d& box_map) {
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(map.tile_size_m);
  const Eigen::AlignedBox2d wide(box_map.min() - margin, box_map.max() + margin);
  MapView part = map;
  std::erase_if(part.tiles, [&](const auto& tile) {
    const Eigen::AlignedBox3d footprint = tile_footprint(tile->info.id, map.tile_size_m);
    const Eigen::AlignedBox2d plan(Eigen::Vector2d(footprint.min().head<2>()),
                                   Eigen::Vector2d(footprint.max().head<2>()));
    return !wide.intersects(plan);
  });
  return part;
}

}  // namespace

AreaAtlas::AreaAtlas(const AreaBoard& areas, const MapBoard& maps, TileReader& tiles)
    : areas_(areas), maps_(maps), tiles_(tiles) {}

std::shared_ptr<const TraversabilityView> AreaAtlas::view(
    const std::string& profile, const Eigen::AlignedBox2d& box_map) const {
  const auto kept = areas_.view(profile);
  const auto map = maps_.view();
  const auto away = [](const auto& tile) { return is_away(*tile); };
  if (std::ranges::none_of(map->tiles, away)) return kept;
  MapView part = part_of(*map, box_map);
  if (std::ranges::none_of(part.tiles, away)) return kept;
  if (part.tiles.size() > most_tiles) {
    throw std::invalid_argument("the region has " + std::to_string(part.tiles.size()) +
                                " tiles, of which some are on disk; at most " +
                                std::to_string(most_tiles) + " can be answered: ask for parts");
  }
  for (auto& tile : part.tiles) tile = tiles_.whole(tile);
  TraversabilityMap worked_out({kept->profile});
  static_cast<void>(worked_out.update(part));
  return worked_out.view(profile);
}

}  // namespace stillmap
