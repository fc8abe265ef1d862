#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// When the tiles of a map appeared, and when others left it: what a view and its tiles' revisions
/// alone cannot tell.
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
  /// What changed since this version, or a later one, can be told.
  std::uint64_t known_since = 0;
  /// Every tile of the newest view, sorted by id.
  std::vector<Event> appeared;
  /// Tiles that are gone, in the order of leaving.
  std::vector<Event> removed;
};

/// Tiles that are gone and remembered; the oldest are forgotten, and with them the changes since
/// versions before.
inline constexpr std::size_t max_removed_tiles = 10'000;

/// The history of a map of which nothing is known but this view.
[[nodiscard]] TileHistory history_from(const MapSnapshot& view);

/// The history once `next` follows. A view of another map, or an earlier one, begins a new history.
[[nodiscard]] TileHistory history_with(const TileHistory& before, const MapSnapshot& next,
                                       std::size_t max_removed = max_removed_tiles);

/// A state of the map and how it came to be. Safe to read from any thread.
struct MapState {
  std::shared_ptr<const MapSnapshot> view;
  std::shared_ptr<const TileHistory> history;
};

}  // namespace stillmap
