#include <SQLiteCpp/Column.h>
#include <tbb/parallel_for.h>

#include <utility>
#include <vector>

#include "core/map/storage/map_tables.hpp"
#include "core/map/storage/stored_rows.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/map/storage/tile_evidence_codec.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

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

TileRow tile_row(const SQLite::Statement& row) {
  return {column_tile_id(row), column_state(row), column_blob(row, 4)};
}

VoxelGrid grid_of(const MapSnapshot& sizes) {
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
    if (tile.info.id != row.id || stored_state_of(tile.info) != row.state ||
        content_hash(tile.info.id, tile.voxels, grid) != tile.info.content_hash) {
      throw TileCodecError("does not agree with its content hash");
    }
    return std::make_shared<const Tile>(std::move(tile));
  } catch (const TileCodecError& error) {
    throw TileCodecError(tile_name(row.id) + error.what());
  }
}

std::shared_ptr<const TileEvidence> checked_evidence(TileId id, const Blob& encoded) {
  try {
    TileEvidence evidence = decode_evidence(encoded);
    if (evidence.id != id) throw TileCodecError("has the memory of another tile");
    return std::make_shared<const TileEvidence>(std::move(evidence));
  } catch (const TileCodecError& error) {
    throw TileCodecError(tile_name(id) + error.what());
  }
}

void check_consistency(const Tile* tile, const TileEvidence* evidence, TileId id) {
  const std::size_t shown = tile == nullptr ? 0 : tile->voxels.size();
  if (evidence != nullptr && evidence->shown.size() != shown) {
    throw TileCodecError(tile_name(id) + "has a memory of " +
                         std::to_string(evidence->shown.size()) + " shown voxels, but shows " +
                         std::to_string(shown));
  }
}

}  // namespace

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

TileEvidenceMap read_tile_evidence(SQLite::Database& database) {
  std::vector<std::pair<TileId, Blob>> rows;
  SQLite::Statement row(database, "SELECT x, y, encoded FROM memories");
  while (row.executeStep()) rows.emplace_back(column_tile_id(row), column_blob(row, 2));
  std::vector<std::shared_ptr<const TileEvidence>> decoded(rows.size());
  tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t i) {
    decoded[i] = checked_evidence(rows[i].first, rows[i].second);
  });
  TileEvidenceMap tile_evidence;
  for (std::size_t i = 0; i < rows.size(); ++i) tile_evidence.emplace(rows[i].first, decoded[i]);
  return tile_evidence;
}

TileEvidenceMap read_tile_evidence_ids(SQLite::Database& database) {
  TileEvidenceMap ids;
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
  if (tile.executeStep()) record.tile = checked_tile(tile_row(tile), grid_of(sizes));
  SQLite::Statement evidence(database, "SELECT x, y, encoded FROM memories WHERE x = ? AND y = ?");
  bind_id(evidence, id);
  if (evidence.executeStep()) record.evidence = checked_evidence(id, column_blob(evidence, 2));
  check_consistency(record.tile.get(), record.evidence.get(), id);
  return record;
}

}  // namespace stillmap
