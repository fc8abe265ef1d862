#include "core/map/storage/stored_rows.hpp"

#include <SQLiteCpp/Column.h>

#include "core/map/storage/tile_codec.hpp"

namespace stillmap {
namespace {

/// Of a tile farther out, numbers of cells, at most 256 along its side, would not fit 31 bits; maps
/// end long before (VoxelGrid::max_coordinate_m).
constexpr int max_tile_index = 1 << 22;

bool is_in_range(int index) { return index >= -max_tile_index && index <= max_tile_index; }

}  // namespace

StoredState stored_state_of(const TileInfo& info) {
  return {signed_bits(info.revision), signed_bits(info.content_hash)};
}

std::string tile_name(TileId id) {
  return "tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) + ") ";
}

TileId column_tile_id(const SQLite::Statement& row) {
  const TileId id{row.getColumn(0).getInt(), row.getColumn(1).getInt()};
  if (!is_in_range(id.x) || !is_in_range(id.y)) {
    throw TileCodecError(tile_name(id) + "lies farther out than any map goes");
  }
  return id;
}

StoredState column_state(const SQLite::Statement& row) {
  return {row.getColumn(2).getInt64(), row.getColumn(3).getInt64()};
}

void bind_id(SQLite::Statement& statement, TileId id) {
  statement.bind(1, id.x);
  statement.bind(2, id.y);
}

}  // namespace stillmap
