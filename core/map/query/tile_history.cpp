#include "core/map/query/tile_history.hpp"

#include <algorithm>

namespace stillmap {
namespace {

using Event = TileHistory::Event;

const Event* find(const std::vector<Event>& sorted, TileId id) {
  const auto found = std::ranges::lower_bound(sorted, id, {}, &Event::id);
  return found != sorted.end() && found->id == id ? &*found : nullptr;
}

/// Drops the oldest beyond `max_events`.
void drop_oldest(TileHistory& history, std::size_t max_events) {
  if (history.removed.size() <= max_events) return;
  const auto kept = history.removed.end() - static_cast<std::ptrdiff_t>(max_events);
  history.known_since = std::max(history.known_since, (kept - 1)->version);
  history.removed.erase(history.removed.begin(), kept);
}

}  // namespace

TileHistory history_from(const MapSnapshot& view) {
  TileHistory history{view.map_id, view.version, view.version, {}, {}};
  for (const auto& tile : view.tiles) {
    history.appeared.push_back({tile->info.id, tile->info.revision});
  }
  return history;
}

TileHistory history_with(const TileHistory& before, const MapSnapshot& next,
                         std::size_t max_removed) {
  if (next.map_id != before.map_id || next.version < before.version) return history_from(next);
  TileHistory history{next.map_id, next.version, before.known_since, {}, {}};
  history.appeared.reserve(next.tiles.size());
  for (const auto& tile : next.tiles) {
    const Event* const known = find(before.appeared, tile->info.id);
    history.appeared.push_back(known ? *known : Event{tile->info.id, tile->info.revision});
  }
  const auto is_there = [&](const Event& event) { return find(history.appeared, event.id); };
  std::ranges::remove_copy_if(before.removed, std::back_inserter(history.removed), is_there);
  for (const Event& event : before.appeared) {
    if (!is_there(event)) history.removed.push_back({event.id, next.version});
  }
  drop_oldest(history, max_removed);
  return history;
}

}  // namespace stillmap
