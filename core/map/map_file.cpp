#include "core/map/map_file.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>
#include <tbb/parallel_for.h>

#include <cstdint>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "core/map/map_database.hpp"
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

TileId column_tile_id(const SQLite::Statement& row) {
  return {row.getColumn(0).getInt(), row.getColumn(1).getInt()};
}

std::map<TileId, TileState> stored_tiles(SQLite::Database& database) {
  std::map<TileId, TileState> stored;
  SQLite::Statement row(database, "SELECT x, y, revision, content_hash FROM tiles");
  while (row.executeStep()) {
    stored[column_tile_id(row)] = {row.getColumn(2).getInt64(), row.getColumn(3).getInt64()};
  }
  return stored;
}

void write_tiles(SQLite::Database& database, std::span<const Tile* const> tiles) {
  std::vector<Blob> blobs(tiles.size());
  tbb::parallel_for(std::size_t{0}, tiles.size(),
                    [&](std::size_t i) { blobs[i] = encode_tile(*tiles[i]); });
  SQLite::Statement insert(database, "INSERT OR REPLACE INTO tiles VALUES (?, ?, ?, ?, ?)");
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const TileInfo& info = tiles[i]->info;
    insert.bind(1, info.id.x);
    insert.bind(2, info.id.y);
    insert.bind(3, signed_bits(info.revision));
    insert.bind(4, signed_bits(info.content_hash));
    insert.bindNoCopy(5, blobs[i].data(), static_cast<int>(blobs[i].size()));
    insert.exec();
    insert.reset();
  }
}

void save_tiles(SQLite::Database& database, const MapView& view) {
  std::map<TileId, TileState> stored = stored_tiles(database);
  std::vector<const Tile*> changed;
  for (const auto& tile : view.tiles) {
    const auto known = stored.extract(tile->info.id);
    if (!known || known.mapped() != state_of(tile->info)) changed.push_back(tile.get());
  }
  write_tiles(database, changed);
  SQLite::Statement remove(database, "DELETE FROM tiles WHERE x = ? AND y = ?");
  for (const auto& [id, state] : stored) {
    remove.bind(1, id.x);
    remove.bind(2, id.y);
    remove.exec();
    remove.reset();
  }
}

void save_trajectory(SQLite::Database& database, const Trajectory& trajectory) {
  database.exec("DELETE FROM trajectory");
  SQLite::Statement insert(database, "INSERT INTO trajectory VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  std::int64_t position = 0;
  for (const auto& [stamp_ns, T_map_lidar] : trajectory) {
    const Eigen::Vector3d t = T_map_lidar.translation();
    const Eigen::Quaterniond q(T_map_lidar.linear());
    insert.bind(1, position++);
    insert.bind(2, stamp_ns);
    int column = 3;
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      insert.bind(column++, value);
    }
    insert.exec();
    insert.reset();
  }
}

void save_metadata(SQLite::Database& database, const StoredMap& map) {
  database.exec("DELETE FROM metadata");
  SQLite::Statement insert(database, "INSERT INTO metadata VALUES (?, ?)");
  for (const auto& [key, value] : map.metadata) {
    insert.bind(1, key);
    insert.bind(2, value);
    insert.exec();
    insert.reset();
  }
  SQLite::Statement row(database, "INSERT OR REPLACE INTO map VALUES (0, ?, ?, ?, ?)");
  row.bind(1, signed_bits(map.view.map_id));
  row.bind(2, signed_bits(map.view.version));
  row.bind(3, map.view.tile_size_m);
  row.bind(4, map.view.voxel_size_m);
  row.exec();
}

struct StoredTile {
  TileId id;
  TileState state;
  Blob encoded;
};

std::vector<StoredTile> read_blobs(SQLite::Database& database) {
  std::vector<StoredTile> stored;
  SQLite::Statement row(database,
                        "SELECT x, y, revision, content_hash, encoded FROM tiles ORDER BY x, y");
  while (row.executeStep()) {
    const auto* bytes = static_cast<const std::uint8_t*>(row.getColumn(4).getBlob());
    const int size = row.getColumn(4).getBytes();
    stored.push_back({column_tile_id(row),
                      {row.getColumn(2).getInt64(), row.getColumn(3).getInt64()},
                      Blob(bytes, bytes + size)});
  }
  return stored;
}

/// Throws TileCodecError, also when the tile is not the one that the row is of.
Tile checked_tile(const StoredTile& stored, const VoxelGrid& grid) {
  Tile tile = decode_tile(stored.encoded);
  if (tile.info.id != stored.id || state_of(tile.info) != stored.state ||
      content_hash(tile.info.id, tile.voxels, grid) != tile.info.content_hash) {
    throw TileCodecError("does not agree with its content hash");
  }
  return tile;
}

std::vector<std::shared_ptr<const Tile>> decode_tiles(const std::vector<StoredTile>& stored,
                                                      const VoxelGrid& grid) {
  std::vector<std::shared_ptr<const Tile>> tiles(stored.size());
  tbb::parallel_for(std::size_t{0}, stored.size(), [&](std::size_t i) {
    try {
      tiles[i] = std::make_shared<const Tile>(checked_tile(stored[i], grid));
    } catch (const TileCodecError& error) {
      const TileId id = stored[i].id;
      throw TileCodecError("tile (" + std::to_string(id.x) + ", " + std::to_string(id.y) + ") " +
                           error.what());
    }
  });
  return tiles;
}

MapView load_view(SQLite::Database& database) {
  MapView view;
  SQLite::Statement row(database, "SELECT map_id, version, tile_size_m, voxel_size_m FROM map");
  if (!row.executeStep()) return view;
  view.map_id = unsigned_bits(row.getColumn(0).getInt64());
  view.version = unsigned_bits(row.getColumn(1).getInt64());
  view.tile_size_m = row.getColumn(2).getDouble();
  view.voxel_size_m = row.getColumn(3).getDouble();
  const std::vector<StoredTile> stored = read_blobs(database);
  if (stored.empty()) return view;
  const double columns = view.tile_size_m / view.voxel_size_m;
  if (!(columns >= 0.5 && columns <= VoxelGrid::max_columns + 0.5)) {
    throw TileCodecError("the map has tiles of " + std::to_string(view.tile_size_m) +
                         " m with voxels of " + std::to_string(view.voxel_size_m) + " m");
  }
  view.tiles = decode_tiles(stored, VoxelGrid(view.voxel_size_m, view.tile_size_m));
  return view;
}

Trajectory load_trajectory(SQLite::Database& database) {
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

class SqliteTileStore : public TileStore {
 public:
  explicit SqliteTileStore(const std::filesystem::path& file)
      : file_(file), database_(open_map_database(file)) {}

  void save(const StoredMap& map) override {
    try {
      SQLite::Transaction transaction(database_, SQLite::TransactionBehavior::IMMEDIATE);
      save_tiles(database_, map.view);
      save_trajectory(database_, map.trajectory);
      save_metadata(database_, map);
      transaction.commit();
      // The log's content into the file, so that a copy of the file alone is a copy of the map.
      database_.exec("PRAGMA wal_checkpoint(TRUNCATE)");
    } catch (const SQLite::Exception& error) {
      throw MapFileError(file_, std::string("cannot be saved (") + error.what() +
                                    "); the last save is still there");
    } catch (const TileCodecError& error) {
      throw MapFileError(file_, std::string("cannot be saved: a tile ") + error.what());
    }
  }

  StoredMap load() override {
    try {
      const SQLite::Transaction one_state(database_);
      StoredMap map;
      map.view = load_view(database_);
      map.trajectory = load_trajectory(database_);
      SQLite::Statement row(database_, "SELECT key, value FROM metadata");
      while (row.executeStep()) map.metadata[row.getColumn(0)] = row.getColumn(1).getString();
      return map;
    } catch (const std::runtime_error& error) {
      throw MapFileError(file_, std::string("cannot be read (") + error.what() +
                                    "); restore a copy or name another file");
    }
  }

 private:
  std::filesystem::path file_;
  SQLite::Database database_;
};

}  // namespace

std::unique_ptr<TileStore> open_map_file(const std::filesystem::path& file) {
  return std::make_unique<SqliteTileStore>(file);
}

}  // namespace stillmap
