#pragma once

#include <SQLiteCpp/Database.h>

#include "core/map/storage/map_file.hpp"

namespace stillmap {

// The tables of a map file, row by row. All throw SQLite::Exception, and TileCodecError for a tile
// that is not what it should be.

/// Writes the tiles that differ from those `stored`, which are what the rows hold, or have evidence
/// given, without their evidence, and deletes the rows of tiles that are no more. Non-resident
/// tiles must be stored in this state.
void write_tiles(SQLite::Database& database, const TileTable& stored, const TileTable& tiles,
                 const TileEvidenceMap& tile_evidence);
/// Writes the evidence given; with `forget_others`, deletes all other.
void write_tile_evidence(SQLite::Database& database, const TileEvidenceMap& tile_evidence,
                         bool forget_others);
/// Replaces the rows from this pose on.
void write_trajectory(SQLite::Database& database, const SharedTrajectory& trajectory,
                      std::size_t from);
void write_metadata(SQLite::Database& database, const SavedMap& map);

/// Id, version and sizes of the map, without tiles.
[[nodiscard]] MapSnapshot read_map_row(SQLite::Database& database);
/// Of a map with these sizes; checked against their content hashes.
[[nodiscard]] std::vector<std::shared_ptr<const Tile>> read_tiles(SQLite::Database& database,
                                                                  const MapSnapshot& sizes);
/// Without their voxels, from their index alone (`index_tile_infos`).
[[nodiscard]] TileTable read_tile_infos(SQLite::Database& database);
[[nodiscard]] TileEvidenceMap read_tile_evidence(SQLite::Database& database,
                                                 const MapSnapshot& sizes);
/// The tiles that have evidence but show nothing, with null for each.
[[nodiscard]] TileEvidenceMap read_hidden_tile_ids(SQLite::Database& database);
[[nodiscard]] SharedTrajectory read_trajectory(SQLite::Database& database);
[[nodiscard]] std::map<std::string, std::string> read_metadata(SQLite::Database& database);

/// Throws when evidence does not belong to the state of its tile.
void check_consistency(const SavedMap& map);

/// One tile of a map with these sizes, checked as read_tiles does.
[[nodiscard]] TileRecord read_record(SQLite::Database& database, TileId id,
                                     const MapSnapshot& sizes);

}  // namespace stillmap
