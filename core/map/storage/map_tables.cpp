#include "core/map/storage/map_tables.hpp"

#include <SQLiteCpp/Column.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <sqlite3.h>
#include <tbb/parallel_for.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/map/storage/tile_codec.hpp"
#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

// What reading and writing the tables of a map file share.

using Blob = std::vector<std::uint8_t>;

/// SQLite's integers are signed; the bits are what counts.
std::int64_t signed_bits(std::uint64_t value) { return static_cast<std::int64_t>(value); }
std::uint64_t unsigned_bits(std::int64_t value) { return static_cast<std::uint64_t>(value); }

/// What identifies a tile's state: its revision and content hash.
using StoredState = std::pair<std::int64_t, std::int64_t>;

/// Of a tile farther out, numbers of cells, at most 256 along its side, would not fit 31 bits; maps
/// end long before (VoxelGrid::max_coordinate_m).
constexpr int max_tile_index = 1 << 22;

bool is_in_range(int index) { return index >= -max_tile_index && index <= max_tile_index; }

StoredState stored_state_of(const TileInfo& info) {
  return {signed_bits(info.revision), signed_bits(info.content_hash)};
}

/// For errors: "tile (x, y) ".
std::string tile_name(TileId id) {
  return "tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) + ") ";
}

/// Throws TileCodecError for a tile that no map goes out to.
TileId checked_id(TileId id) {
  if (!is_in_range(id.x) || !is_in_range(id.y)) {
    throw TileCodecError(tile_name(id) + "lies farther out than any map goes");
  }
  return id;
}

/// Of a row that begins with x, y; throws TileCodecError for a tile that no map goes out to.
TileId column_tile_id(const SQLite::Statement& row) {
  return checked_id({row.getColumn(0).getInt(), row.getColumn(1).getInt()});
}

/// Rows of a query by SQLite's own interface: of a million rows, SQLiteCpp's columns would cost
/// more than SQLite.
class ManyRows {
 public:
  ManyRows(SQLite::Database& database, const char* query) : database_(database.getHandle()) {
    sqlite3_stmt* statement = nullptr;
    check(sqlite3_prepare_v2(database_, query, -1, &statement, nullptr), SQLITE_OK);
    statement_.reset(statement);
  }
  [[nodiscard]] bool next() {
    const int code = sqlite3_step(statement_.get());
    if (code != SQLITE_DONE) check(code, SQLITE_ROW);
    return code == SQLITE_ROW;
  }
  [[nodiscard]] std::int64_t integer(int column) const {
    return sqlite3_column_int64(statement_.get(), column);
  }
  [[nodiscard]] double real(int column) const {
    return sqlite3_column_double(statement_.get(), column);
  }
  [[nodiscard]] float number(int column) const { return static_cast<float>(real(column)); }
  /// Of x, y in the first columns.
  [[nodiscard]] TileId id() const {
    return checked_id(
        {sqlite3_column_int(statement_.get(), 0), sqlite3_column_int(statement_.get(), 1)});
  }

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  void check(int code, int wanted) const {
    if (code != wanted) throw SQLite::Exception(database_, code);
  }

  sqlite3* database_;
  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

/// Of a row that goes on with revision, content_hash.
StoredState column_state(const SQLite::Statement& row) {
  return {row.getColumn(2).getInt64(), row.getColumn(3).getInt64()};
}

/// The first two parameters.
void bind_id(SQLite::Statement& statement, TileId id) {
  statement.bind(1, id.x);
  statement.bind(2, id.y);
}

void run(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
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

Blob column_blob(const SQLite::Statement& row, int column) {
  const SQLite::Column blob = row.getColumn(column);
  const auto* bytes = static_cast<const std::uint8_t*>(blob.getBlob());
  return Blob(bytes, bytes + blob.getBytes());
}

struct TileRow {
  TileId id;
  StoredState state;
  Blob encoded;
};

/// Into a row that was read before: its memory is used again.
void read_row(const SQLite::Statement& from, TileRow& row) {
  row.id = column_tile_id(from);
  row.state = column_state(from);
  const SQLite::Column blob = from.getColumn(4);
  const auto* bytes = static_cast<const std::uint8_t*>(blob.getBlob());
  row.encoded.assign(bytes, bytes + blob.getBytes());
}

/// The next rows, as many as there are and fit; returns how many.
std::size_t read_rows(SQLite::Statement& from, std::span<TileRow> rows) {
  std::size_t count = 0;
  while (count < rows.size() && from.executeStep()) read_row(from, rows[count++]);
  return count;
}

/// Throws TileCodecError, also when the tile is not the one that the row is of.
std::shared_ptr<const Tile> checked_tile(const TileRow& row, const VoxelGrid& grid) {
  try {
    Tile tile = decode_tile(row.encoded, grid);
    if (tile.info.id != row.id || stored_state_of(tile.info) != row.state ||
        content_hash(tile.voxels.packed()) != tile.info.content_hash) {
      throw TileCodecError("does not agree with its content hash");
    }
    return std::make_shared<const Tile>(std::move(tile));
  } catch (const TileCodecError& error) {
    throw TileCodecError(tile_name(row.id) + error.what());
  }
}

std::shared_ptr<const TileEvidence> checked_evidence(TileId id, const Blob& encoded,
                                                     const VoxelGrid& grid) {
  try {
    TileEvidence evidence = decode_evidence(encoded, grid);
    if (evidence.id != id) throw TileCodecError("has the evidence of another tile");
    return std::make_shared<const TileEvidence>(std::move(evidence));
  } catch (const TileCodecError& error) {
    throw TileCodecError(tile_name(id) + error.what());
  }
}

void check_consistency(const Tile* tile, const TileEvidence* evidence, TileId id) {
  const std::size_t shown = tile == nullptr ? 0 : tile->voxels.size();
  if (evidence != nullptr && evidence->shown.size() != shown) {
    throw TileCodecError(tile_name(id) + "has evidence of " +
                         std::to_string(evidence->shown.size()) + " shown voxels, but shows " +
                         std::to_string(shown));
  }
}

}  // namespace

void write_tiles(SQLite::Database& database, const TileTable& stored, const TileTable& tiles,
                 const TileEvidenceMap& tile_evidence) {
  std::vector<const Tile*> changed;
  std::vector<TileId> gone;
  TileTable::for_each_difference(stored, tiles, [&](const auto& before, const auto& after) {
    if (after == nullptr) return gone.push_back(before->info.id);
    const TileId id = after->info.id;
    const bool is_stored = before && stored_state_of(before->info) == stored_state_of(after->info);
    if (is_non_resident(*after)) {
      if (is_stored) return;
      throw TileCodecError(tile_name(id) + "is neither in memory nor in this file");
    }
    if (!is_stored || tile_evidence.contains(id)) changed.push_back(after.get());
  });
  write_rows(database, changed);
  SQLite::Statement remove(database, "DELETE FROM tiles WHERE x = ? AND y = ?");
  // Evidence is of one state of its tile.
  SQLite::Statement forget(database, "DELETE FROM memories WHERE x = ? AND y = ?");
  for (const Tile* tile : changed) {
    bind_id(forget, tile->info.id);
    run(forget);
  }
  for (const TileId id : gone) {
    for (SQLite::Statement* statement : {&remove, &forget}) {
      bind_id(*statement, id);
      run(*statement);
    }
  }
}

void write_tile_evidence(SQLite::Database& database, const TileEvidenceMap& tile_evidence,
                         bool forget_others) {
  if (forget_others) database.exec("DELETE FROM memories");
  std::vector<const TileEvidence*> given;
  for (const auto& [id, evidence] : tile_evidence) {
    if (evidence) given.push_back(evidence.get());
  }
  std::vector<Blob> blobs(given.size());
  tbb::parallel_for(std::size_t{0}, given.size(),
                    [&](std::size_t i) { blobs[i] = encode_evidence(*given[i]); });
  SQLite::Statement insert(database, "INSERT OR REPLACE INTO memories VALUES (?, ?, ?)");
  for (std::size_t i = 0; i < given.size(); ++i) {
    bind_id(insert, given[i]->id);
    insert.bindNoCopy(3, blobs[i].data(), static_cast<int>(blobs[i].size()));
    run(insert);
  }
}

void write_trajectory(SQLite::Database& database, const SharedTrajectory& trajectory,
                      std::size_t from) {
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

void write_metadata(SQLite::Database& database, const SavedMap& map) {
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

MapSnapshot read_map_row(SQLite::Database& database) {
  MapSnapshot view;
  SQLite::Statement row(database, "SELECT map_id, version, tile_size_m, voxel_size_m FROM map");
  if (!row.executeStep()) return view;
  view.map_id = unsigned_bits(row.getColumn(0).getInt64());
  view.version = unsigned_bits(row.getColumn(1).getInt64());
  view.tile_size_m = row.getColumn(2).getDouble();
  view.voxel_size_m = row.getColumn(3).getDouble();
  return view;
}

std::vector<std::shared_ptr<const Tile>> read_tiles(SQLite::Database& database,
                                                    const MapSnapshot& sizes) {
  // At a time, so that the rows' memory is small and used again: fresh pages cost more than
  // copying.
  std::array<TileRow, 64> rows;
  std::vector<std::shared_ptr<const Tile>> tiles;
  SQLite::Statement row(database,
                        "SELECT x, y, revision, content_hash, encoded FROM tiles ORDER BY x, y");
  while (const std::size_t count = read_rows(row, rows)) {
    const VoxelGrid grid = stored_grid(sizes.voxel_size_m, sizes.tile_size_m);
    const std::size_t begin = tiles.size();
    tiles.resize(begin + count);
    tbb::parallel_for(std::size_t{0}, count,
                      [&](std::size_t i) { tiles[begin + i] = checked_tile(rows[i], grid); });
    if (count < rows.size()) break;
  }
  return tiles;
}

TileTable read_tile_infos(SQLite::Database& database) {
  std::vector<std::shared_ptr<const Tile>> tiles;
  ManyRows row(database,
               "SELECT x, y, revision, content_hash, voxel_count, min_x, min_y, min_z, max_x, "
               "max_y, max_z FROM tiles INDEXED BY tile_infos ORDER BY x, y");
  while (row.next()) {
    auto tile = std::make_shared<Tile>();
    tile->info.id = row.id();
    tile->info.revision = unsigned_bits(row.integer(2));
    tile->info.content_hash = unsigned_bits(row.integer(3));
    tile->info.voxel_count = static_cast<std::uint32_t>(row.integer(4));
    tile->info.bounds_map = {Eigen::Vector3f(row.number(5), row.number(6), row.number(7)),
                             Eigen::Vector3f(row.number(8), row.number(9), row.number(10))};
    tiles.push_back(std::move(tile));
  }
  return TileTable(std::move(tiles));
}

TileEvidenceMap read_tile_evidence(SQLite::Database& database, const MapSnapshot& sizes) {
  std::vector<std::pair<TileId, Blob>> rows;
  SQLite::Statement row(database, "SELECT x, y, encoded FROM memories");
  while (row.executeStep()) rows.emplace_back(column_tile_id(row), column_blob(row, 2));
  if (rows.empty()) return {};
  const VoxelGrid grid = stored_grid(sizes.voxel_size_m, sizes.tile_size_m);
  std::vector<std::shared_ptr<const TileEvidence>> decoded(rows.size());
  tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t i) {
    decoded[i] = checked_evidence(rows[i].first, rows[i].second, grid);
  });
  TileEvidenceMap tile_evidence;
  for (std::size_t i = 0; i < rows.size(); ++i) tile_evidence.emplace(rows[i].first, decoded[i]);
  return tile_evidence;
}

TileEvidenceMap read_hidden_tile_ids(SQLite::Database& database) {
  TileEvidenceMap ids;
  // Both are read from indices, in one order: it takes one pass.
  ManyRows row(database, "SELECT x, y FROM memories EXCEPT SELECT x, y FROM tiles ORDER BY x, y");
  while (row.next()) ids.emplace(row.id(), nullptr);
  return ids;
}

SharedTrajectory read_trajectory(SQLite::Database& database) {
  SharedTrajectory trajectory;
  ManyRows row(database,
               "SELECT stamp_ns, x, y, z, qx, qy, qz, qw FROM trajectory ORDER BY position");
  const auto number = [&row](int column) { return row.real(column); };
  while (row.next()) {
    StampedPose pose;
    pose.stamp_ns = row.integer(0);
    pose.T_map_lidar.translation() = Eigen::Vector3d(number(1), number(2), number(3));
    pose.T_map_lidar.linear() =
        Eigen::Quaterniond(number(7), number(4), number(5), number(6)).toRotationMatrix();
    trajectory.push_back(pose);
  }
  return trajectory;
}

std::map<std::string, std::string> read_metadata(SQLite::Database& database) {
  std::map<std::string, std::string> metadata;
  SQLite::Statement row(database, "SELECT key, value FROM metadata");
  while (row.executeStep()) metadata[row.getColumn(0)] = row.getColumn(1).getString();
  return metadata;
}

void check_consistency(const SavedMap& map) {
  std::map<TileId, const Tile*> tiles;
  for (const auto& tile : map.view.tiles) tiles.emplace(tile->info.id, tile.get());
  for (const auto& [id, evidence] : map.tile_evidence) {
    const auto tile = tiles.find(id);
    check_consistency(tile == tiles.end() ? nullptr : tile->second, evidence.get(), id);
  }
}

TileRecord read_record(SQLite::Database& database, TileId id, const MapSnapshot& sizes) {
  TileRecord record;
  SQLite::Statement tile(
      database, "SELECT x, y, revision, content_hash, encoded FROM tiles WHERE x = ? AND y = ?");
  bind_id(tile, id);
  const auto grid = [&] { return stored_grid(sizes.voxel_size_m, sizes.tile_size_m); };
  TileRow row;
  if (read_rows(tile, {&row, 1}) == 1) record.tile = checked_tile(row, grid());
  SQLite::Statement evidence(database, "SELECT x, y, encoded FROM memories WHERE x = ? AND y = ?");
  bind_id(evidence, id);
  if (evidence.executeStep()) {
    record.evidence = checked_evidence(id, column_blob(evidence, 2), grid());
  }
  check_consistency(record.tile.get(), record.evidence.get(), id);
  return record;
}

}  // namespace stillmap
