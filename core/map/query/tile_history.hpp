#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// When tiles of a map were removed, which a snapshot alone does not tell.
struct TileHistory {
  struct Event {
    TileId id;
    /// Version of the map in which it happened.
    std::uint64_t version = 0;
    friend bool operator==(const Event&, const Event&) = default;
  };

  std::uint64_t map_id = 0;
  /// Of the newest view.
  std::uint64_t version = 0;
  /// Changes since this version, or a later one, are known.
  std::uint64_t known_since = 0;
  /// Removed tiles, in the order of removal.
  std::vector<Event> removed;
};

/// Removed tiles that are kept; the oldest are dropped, and with them the changes since earlier
/// versions.
inline constexpr std::size_t max_removed_tiles = 10'000;

/// A history that begins with this view.
[[nodiscard]] TileHistory history_from(const MapSnapshot& view);

/// A snapshot of the map and its history. Safe to read from any thread.
struct MapState {
  std::shared_ptr<const MapSnapshot> view;
  std::shared_ptr<const TileHistory> history;
};

/// The history of `before` continued by `next`, at the cost of what changed between the two views.
/// A view of another map, or an earlier one, begins a new history.
[[nodiscard]] TileHistory history_with(const MapState& before, const MapSnapshot& next,
                                       std::size_t max_removed = max_removed_tiles);

}  // namespace stillmap
