#include <tbb/parallel_for.h>

#include <span>
#include <vector>

#include "core/map/storage/map_tables.hpp"
#include "core/map/storage/stored_rows.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/map/storage/tile_evidence_codec.hpp"

namespace stillmap {
namespace {

void run(SQLite::Statement& statement) {
  statement.exec();
  statement.reset();
}

std::map<TileId, StoredState> stored_states(SQLite::Database& database) {
  std::map<TileId, StoredState> stored;
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

}  // namespace

void write_tiles(SQLite::Database& database, const SavedMap& map) {
  std::map<TileId, StoredState> stored = stored_states(database);
  std::vector<const Tile*> changed;
  for (const auto& tile : map.view.tiles) {
    const auto known = stored.extract(tile->info.id);
    const bool is_stored = known && known.mapped() == stored_state_of(tile->info);
    if (is_non_resident(*tile)) {
      if (is_stored) continue;
      throw TileCodecError(tile_name(tile->info.id) + "is neither in memory nor in this file");
    }
    if (!is_stored || map.tile_evidence.contains(tile->info.id)) changed.push_back(tile.get());
  }
  write_rows(database, changed);
  SQLite::Statement remove(database, "DELETE FROM tiles WHERE x = ? AND y = ?");
  // Evidence is of one state of its tile.
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

}  // namespace stillmap
