#include "core/map/query/tile_history.hpp"

#include <algorithm>
#include <set>

namespace stillmap {
namespace {

/// Drops the oldest beyond `max_events`.
void drop_oldest(TileHistory& history, std::size_t max_events) {
  if (history.removed.size() <= max_events) return;
  const auto kept = history.removed.end() - static_cast<std::ptrdiff_t>(max_events);
  history.known_since = std::max(history.known_since, (kept - 1)->version);
  history.removed.erase(history.removed.begin(), kept);
}

}  // namespace

TileHistory history_from(const MapSnapshot& view) {
  return {view.map_id, view.version, view.version, {}};
}

TileHistory history_with(const MapState& before, const MapSnapshot& next, std::size_t max_removed) {
  const TileHistory& known = *before.history;
  if (next.map_id != known.map_id || next.version < known.version) return history_from(next);
  std::set<TileId> came_back;
  std::vector<TileHistory::Event> gone;
  TileTable::for_each_difference(before.view->tiles, next.tiles,
                                 [&](const auto& old_tile, const auto& new_tile) {
                                   if (old_tile == nullptr) came_back.insert(new_tile->info.id);
                                   if (new_tile == nullptr)
                                     gone.push_back({old_tile->info.id, next.version});
                                 });
  TileHistory history{next.map_id, next.version, known.known_since, {}};
  std::ranges::remove_copy_if(known.removed, std::back_inserter(history.removed),
                              [&](const auto& event) { return came_back.contains(event.id); });
  history.removed.insert(history.removed.end(), gone.begin(), gone.end());
  drop_oldest(history, max_removed);
  return history;
}

}  // namespace stillmap
