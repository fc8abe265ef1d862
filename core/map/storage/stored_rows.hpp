#pragma once

#include <SQLiteCpp/Statement.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

// What reading and writing the tables of a map file share.

using Blob = std::vector<std::uint8_t>;

/// SQLite's integers are signed; the bits are what counts.
[[nodiscard]] inline std::int64_t signed_bits(std::uint64_t value) {
  return static_cast<std::int64_t>(value);
}
[[nodiscard]] inline std::uint64_t unsigned_bits(std::int64_t value) {
  return static_cast<std::uint64_t>(value);
}

/// What identifies a tile's state: its revision and content hash.
using StoredState = std::pair<std::int64_t, std::int64_t>;

[[nodiscard]] StoredState stored_state_of(const TileInfo& info);

/// For errors: "tile (x, y) ".
[[nodiscard]] std::string tile_name(TileId id);

/// Of a row that begins with x, y; throws TileCodecError for a tile that no map goes out to.
[[nodiscard]] TileId column_tile_id(const SQLite::Statement& row);
/// Of a row that goes on with revision, content_hash.
[[nodiscard]] StoredState column_state(const SQLite::Statement& row);

/// The first two parameters.
void bind_id(SQLite::Statement& statement, TileId id);

}  // namespace stillmap
