#include "core/map/map_tables.hpp"

#include <SQLiteCpp/Statement.h>
#include <tbb/parallel_for.h>

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/map/tile_codec.hpp"
#include "core/map/tile_content.hpp"

namespace stillmap {
namespace {

using Blob = std::vector<std::uint8_t>;

/// SQLite's integers are signed; the bits are what counts.
std::int64_t signed_bits(std::uint64_t value) { return static_cast<std::int64_t>(value); }
std::uint64_t unsigned_bits(std::int64_t value) { return static_cast<std::uint64_t>(value); }

/// What identifies a tile's state: its revision and content hash.
using TileState = std::pair<std::int64_t, std::int64_t>;

TileState state_of(const TileInfo& info) {
  return {signed_bits(info.revision), signed_bits(info.content_hash)};
}

std::string name_of(TileId id) {
  return "tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) + ") ";
}

/// Of a tile farther out, numbers of cells, at most 256 along its side, would not fit 31 bits; maps
/// end long before (VoxelGrid::max_coordinate_m).
constexpr int farthest_tile = 1 << 22;

bool is_near(int index) { return index >= -farthest_tile && index <= farthest_tile; }

TileId column_tile_id(const SQLite::Statement& row) {
  const TileId id{row.getColumn(0).getInt(), row.getColumn(1).getInt()};
  if (!is_near(id.x) || !is_near(id.y)) {
    throw TileCodecError(name_of(id) + "lies farther out than any map goes");
  }
  return id;
}

TileState column_state(const SQLite::Statement& row) {
  return {row.getColumn(2).getInt64(), row.getColumn(3).getInt64()};
}

Blob column_blob(const SQLite::Statement& row, int column) {
  const SQLite::Column blob = row.getColumn(column);
  const auto* bytes = static_cast<const std::uint8_t*>(blob.getBlob());
  return Blob(bytes, bytes + blob.getBytes());
}

void bind_id(SQLite::Statement& statement, TileId id) {
  statement.bind(1, id.x);
  statement.bind(2, id.y);
}

void run(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
}

std::map<TileId, TileState> stored_states(SQLite::Database& database) {
  std::map<TileId, TileState> stored;
  SQLite::Statement row(database, "SELECT x, y, revision, content_hash FROM tiles");
  while (row.executeStep()) stored[column_tile_id(row)] = column_state(row);
  return stored;
}

void write_rows(SQLite::Database& database, std::span<const Tile* const> tiles) {
  std::vector<Blob> blobs(tiles.size());
  tbb::parallel_for(std::size_t{0}, tiles.size(),
                    [&](std::size_t i) { blobs[i] = encode_tile(*tiles[i]); });
  SQLite::Statement insert(
      database, "INSERT OR REPLACE INTO tiles VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const TileInfo& info = tiles[i]->info;
    bind_id(insert, info.id);
    insert.bind(3, signed_bits(info.revision));
    insert.bind(4, signed_bits(info.content_hash));
    insert.bindNoCopy(5, blobs[i].data(), static_cast<int>(blobs[i].size()));
    insert.bind(6, info.voxel_count);
    for (int axis = 0; axis < 3; ++axis) {
      insert.bind(7 + axis, static_cast<double>(info.bounds_map.min()[axis]));
      insert.bind(10 + axis, static_cast<double>(info.bounds_map.max()[axis]));
    }
    run(insert);
  }
}

struct TileRow {
  TileId id;
  TileState state;
  Blob encoded;
};

TileRow tile_row(const SQLite::Statement& row) {
  return {column_tile_id(row), column_state(row), column_blob(row, 4)};
}

VoxelGrid grid_of(const MapView& sizes) {
  const double columns = sizes.tile_size_m / sizes.voxel_size_m;
  if (!(columns >= 0.5 && columns <= VoxelGrid::max_columns + 0.5)) {
    throw TileCodecError("the map has tiles of " + std::to_string(sizes.tile_size_m) +
                         " m with voxels of " + std::to_string(sizes.voxel_size_m) + " m");
  }
  return {sizes.voxel_size_m, sizes.tile_size_m};
}

/// Throws TileCodecError, also when the tile is not the one that the row is of.
std::shared_ptr<const Tile> checked_tile(const TileRow& row, const VoxelGrid& grid) {
  try {
    Tile tile = decode_tile(row.encoded);
    if (tile.info.id != row.id || state_of(tile.info) != row.state ||
        content_hash(tile.info.id, tile.voxels, grid) != tile.info.content_hash) {
      throw TileCodecError("does not agree with its content hash");
    }
    return std::make_shared<const Tile>(std::move(tile));
  } catch (const TileCodecError& error) {
    throw TileCodecError(name_of(row.id) + error.what());
  }
}

std::shared_ptr<const TileMemory> checked_memory(TileId id, const Blob& encoded) {
  try {
    TileMemory memory = decode_memory(encoded);
    if (memory.id != id) throw TileCodecError("has the memory of another tile");
    return std::make_shared<const TileMemory>(std::move(memory));
  } catch (const TileCodecError& error) {
    throw TileCodecError(name_of(id) + error.what());
  }
}

void check_agreement(const Tile* tile, const TileMemory* memory, TileId id) {
  const std::size_t shown = tile == nullptr ? 0 : tile->voxels.size();
  if (memory != nullptr && memory->shown.size() != shown) {
    throw TileCodecError(name_of(id) + "has a memory of " + std::to_string(memory->shown.size()) +
                         " shown voxels, but shows " + std::to_string(shown));
  }
}

}  // namespace

void write_tiles(SQLite::Database& database, const StoredMap& map) {
  std::map<TileId, TileState> stored = stored_states(database);
  std::vector<const Tile*> changed;
  for (const auto& tile : map.view.tiles) {
    const auto known = stored.extract(tile->info.id);
    const bool is_stored = known && known.mapped() == state_of(tile->info);
    if (is_away(*tile)) {
      if (is_stored) continue;
      throw TileCodecError(name_of(tile->info.id) + "is neither in memory nor in this file");
    }
    if (!is_stored || map.memories.contains(tile->info.id)) changed.push_back(tile.get());
  }
  write_rows(database, changed);
  SQLite::Statement remove(database, "DELETE FROM tiles WHERE x = ? AND y = ?");
  // A memory is of one state of its tile.
  SQLite::Statement forget(database, "DELETE FROM memories WHERE x = ? AND y = ?");
  for (const Tile* tile : changed) {
    bind_id(forget, tile->info.id);
    run(forget);
  }
  for (const auto& [id, state] : stored) {
    for (SQLite::Statement* statement : {&remove, &forget}) {
      bind_id(*statement, id);
      run(*statement);
    }
  }
}

void write_memories(SQLite::Database& database, const TileMemories& memories, bool forget_others) {
  if (forget_others) database.exec("DELETE FROM memories");
  std::vector<const TileMemory*> given;
  for (const auto& [id, memory] : memories) {
    if (memory) given.push_back(memory.get());
  }
  std::vector<Blob> blobs(given.size());
  tbb::parallel_for(std::size_t{0}, given.size(),
                    [&](std::size_t i) { blobs[i] = encode_memory(*given[i]); });
  SQLite::Statement insert(database, "INSERT OR REPLACE INTO memories VALUES (?, ?, ?)");
  for (std::size_t i = 0; i < given.size(); ++i) {
    bind_id(insert, given[i]->id);
    insert.bindNoCopy(3, blobs[i].data(), static_cast<int>(blobs[i].size()));
    run(insert);
  }
}

void write_trajectory(SQLite::Database& database, const Trajectory& trajectory, std::size_t from) {
  SQLite::Statement forget(database, "DELETE FROM trajectory WHERE position >= ?");
  forget.bind(1, static_cast<std::int64_t>(from));
  forget.exec();
  SQLite::Statement insert(database, "INSERT INTO trajectory VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (std::size_t position = from; position < trajectory.size(); ++position) {
    const auto& [stamp_ns, T_map_lidar] = trajectory[position];
    const Eigen::Vector3d t = T_map_lidar.translation();
    const Eigen::Quaterniond q(T_map_lidar.linear());
    insert.bind(1, static_cast<std::int64_t>(position));
    insert.bind(2, stamp_ns);
    int column = 3;
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      insert.bind(column++, value);
    }
    run(insert);
  }
}

void write_metadata(SQLite::Database& database, const StoredMap& map) {
  database.exec("DELETE FROM metadata");
  SQLite::Statement insert(database, "INSERT INTO metadata VALUES (?, ?)");
  for (const auto& [key, value] : map.metadata) {
    insert.bind(1, key);
    insert.bind(2, value);
    run(insert);
  }
  SQLite::Statement row(database, "INSERT OR REPLACE INTO map VALUES (0, ?, ?, ?, ?)");
  row.bind(1, signed_bits(map.view.map_id));
  row.bind(2, signed_bits(map.view.version));
  row.bind(3, map.view.tile_size_m);
  row.bind(4, map.view.voxel_size_m);
  row.exec();
}

MapView read_map_row(SQLite::Database& database) {
  MapView view;
  SQLite::Statement row(database, "SELECT map_id, version, tile_size_m, voxel_size_m FROM map");
  if (!row.executeStep()) return view;
  view.map_id = unsigned_bits(row.getColumn(0).getInt64());
  view.version = unsigned_bits(row.getColumn(1).getInt64());
  view.tile_size_m = row.getColumn(2).getDouble();
  view.voxel_size_m = row.getColumn(3).getDouble();
  return view;
}

std::vector<std::shared_ptr<const Tile>> read_tiles(SQLite::Database& database,
                                                    const MapView& sizes) {
  std::vector<TileRow> rows;
  SQLite::Statement row(database,
                        "SELECT x, y, revision, content_hash, encoded FROM tiles ORDER BY x, y");
  while (row.executeStep()) rows.push_back(tile_row(row));
  if (rows.empty()) return {};
  const VoxelGrid grid = grid_of(sizes);
  std::vector<std::shared_ptr<const Tile>> tiles(rows.size());
  tbb::parallel_for(std::size_t{0}, rows.size(),
                    [&](std::size_t i) { tiles[i] = checked_tile(rows[i], grid); });
  return tiles;
}

std::vector<std::shared_ptr<const Tile>> read_tile_infos(SQLite::Database& database) {
  std::vector<std::shared_ptr<const Tile>> tiles;
  SQLite::Statement row(database,
                        "SELECT x, y, revision, content_hash, voxel_count, min_x, min_y, min_z, "
                        "max_x, max_y, max_z FROM tiles ORDER BY x, y");
  const auto number = [&row](int column) {
    return static_cast<float>(row.getColumn(column).getDouble());
  };
  while (row.executeStep()) {
    Tile tile;
    tile.info.id = column_tile_id(row);
    tile.info.revision = unsigned_bits(row.getColumn(2).getInt64());
    tile.info.content_hash = unsigned_bits(row.getColumn(3).getInt64());
    tile.info.voxel_count = row.getColumn(4).getUInt();
    tile.info.bounds_map = {Eigen::Vector3f(number(5), number(6), number(7)),
                            Eigen::Vector3f(number(8), number(9), number(10))};
    tiles.push_back(std::make_shared<const Tile>(std::move(tile)));
  }
  return tiles;
}

TileMemories read_memories(SQLite::Database& database) {
  std::vector<std::pair<TileId, Blob>> rows;
  SQLite::Statement row(database, "SELECT x, y, encoded FROM memories");
  while (row.executeStep()) rows.emplace_back(column_tile_id(row), column_blob(row, 2));
  std::vector<std::shared_ptr<const TileMemory>> decoded(rows.size());
  tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t i) {
    decoded[i] = checked_memory(rows[i].first, rows[i].second);
  });
  TileMemories memories;
  for (std::size_t i = 0; i < rows.size(); ++i) memories.emplace(rows[i].first, decoded[i]);
  return memories;
}

TileMemories read_memory_ids(SQLite::Database& database) {
  TileMemories ids;
  SQLite::Statement row(database, "SELECT x, y FROM memories");
  while (row.executeStep()) ids.emplace(column_tile_id(row), nullptr);
  return ids;
}

Trajectory read_trajectory(SQLite::Database& database) {
  Trajectory trajectory;
  SQLite::Statement row(
      database, "SELECT stamp_ns, x, y, z, qx, qy, qz, qw FROM trajectory ORDER BY position");
  const auto number = [&row](int column) { return row.getColumn(column).getDouble(); };
  while (row.executeStep()) {
    StampedPose& pose = trajectory.emplace_back();
    pose.stamp_ns = row.getColumn(0).getInt64();
    pose.T_map_lidar.translation() = Eigen::Vector3d(number(1), number(2), number(3));
    pose.T_map_lidar.linear() =
        Eigen::Quaterniond(number(7), number(4), number(5), number(6)).toRotationMatrix();
  }
  return trajectory;
}

std::map<std::string, std::string> read_metadata(SQLite::Database& database) {
  std::map<std::string, std::string> metadata;
  SQLite::Statement row(database, "SELECT key, value FROM metadata");
  while (row.executeStep()) metadata[row.getColumn(0)] = row.getColumn(1).getString();
  return metadata;
}

void check_agreement(const StoredMap& map) {
  std::map<TileId, const Tile*> tiles;
  for (const auto& tile : map.view.tiles) tiles.emplace(tile->info.id, tile.get());
  for (const auto& [id, memory] : map.memories) {
    const auto tile = tiles.find(id);
    check_agreement(tile == tiles.end() ? nullptr : tile->second, memory.get(), id);
  }
}

TileRecord read_record(SQLite::Database& database, TileId id, const MapView& sizes) {
  TileRecord record;
  SQLite::Statement tile(
      database, "SELECT x, y, revision, content_hash, encoded FROM tiles WHERE x = ? AND y = ?");
  bind_id(tile, id);
  if (tile.executeStep()) record.tile = checked_tile(tile_row(tile), grid_of(sizes));
  SQLite::Statement memory(database, "SELECT x, y, encoded FROM memories WHERE x = ? AND y = ?");
  bind_id(memory, id);
  if (memory.executeStep()) record.memory = checked_memory(id, column_blob(memory, 2));
  check_agreement(record.tile.get(), record.memory.get(), id);
  return record;
}

}  // namespace stillmap
