#include "core/map/query/tile_history.hpp"

#include <algorithm>

namespace stillmap {
namespace {

using Event = TileHistory::Event;

const Event* find(const std::vector<Event>& sorted, TileId id) {
  const auto found = std::ranges::lower_bound(sorted, id, {}, &Event::id);
  return found != sorted.end() && found->id == id ? &*found : nullptr;
}

/// Beyond `most`, the oldest are forgotten.
void forget_oldest(TileHistory& history, std::size_t most) {
  if (history.gone.size() <= most) return;
  const auto kept = history.gone.end() - static_cast<std::ptrdiff_t>(most);
  history.known_since = std::max(history.known_since, (kept - 1)->version);
  history.gone.erase(history.gone.begin(), kept);
}

}  // namespace

TileHistory history_from(const MapView& view) {
  TileHistory history{view.map_id, view.version, view.version, {}, {}};
  for (const auto& tile : view.tiles) {
    history.appeared.push_back({tile->info.id, tile->info.revision});
  }
  return history;
}

TileHistory history_with(const TileHistory& before, const MapView& next, std::size_t most_gone) {
  if (next.map_id != before.map_id || next.version < before.version) return history_from(next);
  TileHistory history{next.map_id, next.version, before.known_since, {}, {}};
  history.appeared.reserve(next.tiles.size());
  for (const auto& tile : next.tiles) {
    const Event* const known = find(before.appeared, tile->info.id);
    history.appeared.push_back(known ? *known : Event{tile->info.id, tile->info.revision});
  }
  const auto is_there = [&](const Event& event) { return find(history.appeared, event.id); };
  std::ranges::remove_copy_if(before.gone, std::back_inserter(history.gone), is_there);
  for (const Event& event : before.appeared) {
    if (!is_there(event)) history.gone.push_back({event.id, next.version});
  }
  forget_oldest(history, most_gone);
  return history;
}

}  // namespace stillmap
