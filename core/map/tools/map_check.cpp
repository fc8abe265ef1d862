#include "core/map/tools/map_check.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_tables.hpp"
#include "core/map/storage/session_tables.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

struct MapRow {
  std::uint64_t version = 0;
  double tile_size_m = 0.0;
  double voxel_size_m = 0.0;
};

struct TileRow {
  TileId id;
  std::uint64_t revision = 0;
  std::uint64_t content_hash = 0;
  /// As encode_tile wrote it; valid as long as the database's row.
  std::span<const std::uint8_t> encoded;
};

/// What a row says of the tile that it holds, by which regions find it.
struct TileRowSummary {
  std::uint32_t voxel_count = 0;
  Eigen::AlignedBox3d bounds_map;
};

struct PoseRow {
  std::int64_t stamp_ns = 0;
  /// x y z [m], then the quaternion's x y z w.
  std::array<double, 7> values{};
};

std::vector<std::string> voxel_faults(const Tile& tile, const VoxelGrid& grid) {
  const auto is_outside = [&](const PackedVoxel& voxel) {
    const VoxelIndex index = voxel_index(voxel.key);
    return index.x >= grid.columns() || index.y >= grid.columns();
  };
  std::vector<std::string> faults;
  if (const auto count = std::ranges::count_if(tile.voxels.packed(), is_outside); count > 0) {
    faults.push_back("has " + std::to_string(count) + " voxels outside of the tile");
  }
  return faults;
}

/// Whether tiles are some whole number of voxels wide that a VoxelGrid takes.
bool has_usable_sizes(const MapRow& map) {
  const double columns = map.tile_size_m / map.voxel_size_m;
  return map.voxel_size_m > 0.0 && columns >= 0.5 && columns <= VoxelGrid::max_columns + 0.5;
}

/// What is wrong with a tile that was decoded from `row`; `map` has usable sizes.
std::vector<std::string> tile_faults(const Tile& tile, const TileRow& row, const MapRow& map) {
  std::vector<std::string> faults =
      voxel_faults(tile, VoxelGrid(map.voxel_size_m, map.tile_size_m));
  if (tile.info.id != row.id) {
    faults.push_back("says that it is tile (" + std::to_string(tile.info.id.x) + ", " +
                     std::to_string(tile.info.id.y) + ")");
  }
  if (tile.info.revision != row.revision || tile.info.content_hash != row.content_hash) {
    faults.emplace_back("does not agree with its row's revision and hash");
  }
  if (content_hash(tile.voxels.packed()) != tile.info.content_hash) {
    faults.emplace_back("does not agree with its content hash");
  }
  if (row.revision > map.version) {
    faults.push_back("has revision " + std::to_string(row.revision) + ", the map is at version " +
                     std::to_string(map.version));
  }
  return faults;
}

std::vector<std::string> pose_faults(const PoseRow& pose) {
  constexpr double rotation_slack = 1e-3;
  const auto& values = pose.values;
  std::vector<std::string> faults;
  if (!std::ranges::all_of(values, [](double value) { return std::isfinite(value); })) {
    faults.emplace_back("is not finite");
    return faults;
  }
  if (std::max({std::abs(values[0]), std::abs(values[1]), std::abs(values[2])}) >
      VoxelGrid::max_coordinate_m) {
    faults.emplace_back("is farther from the origin than any map goes");
  }
  const double norm =
      std::hypot(std::hypot(values[3], values[4]), std::hypot(values[5], values[6]));
  if (std::abs(norm - 1.0) > rotation_slack) {
    faults.push_back("has a quaternion of norm " + std::to_string(norm));
  }
  return faults;
}

/// Runs one part of the check; an exception of the database is a fault.
template <typename Part>
void guarded(MapCheck& check, const std::string& place, Part part) {
  try {
    part();
  } catch (const SQLite::Exception& error) {
    check.faults.push_back(
        {place, std::nullopt, std::string("cannot be read on: ") + error.what()});
  }
}

/// SQLite's own faults: pages, indexes, order.
void check_pages(const MapFileCopy& copy, MapCheck& check) {
  try {
    SQLite::Database database(copy.path().string());
    SQLite::Statement row(database, "PRAGMA integrity_check");
    while (row.executeStep()) {
      const std::string verdict = row.getColumn(0).getString();
      if (verdict != "ok") check.faults.push_back({"file", std::nullopt, verdict});
    }
  } catch (const SQLite::Exception& error) {
    if (error.getErrorCode() == SQLITE_NOTADB) copy.check_format();
    check.faults.push_back({"file", std::nullopt, error.what()});
  }
}

std::optional<MapRow> check_map_row(SQLite::Database& database, std::size_t tiles,
                                    MapCheck& check) {
  const auto fault = [&](const std::string& what) {
    check.faults.push_back({"map", std::nullopt, what});
  };
  SQLite::Statement row(database, "SELECT version, tile_size_m, voxel_size_m FROM map");
  if (!row.executeStep()) {
    if (tiles > 0) fault("has tiles and does not say of which size");
    return std::nullopt;
  }
  const MapRow map{.version = static_cast<std::uint64_t>(row.getColumn(0).getInt64()),
                   .tile_size_m = row.getColumn(1).getDouble(),
                   .voxel_size_m = row.getColumn(2).getDouble()};
  if (tiles == 0 || has_usable_sizes(map)) return map;
  fault("has tiles of " + std::to_string(map.tile_size_m) + " m with voxels of " +
        std::to_string(map.voxel_size_m) + " m");
  return std::nullopt;
}

TileRow tile_row(const SQLite::Statement& row) {
  const auto* bytes = static_cast<const std::uint8_t*>(row.getColumn(4).getBlob());
  const auto size = static_cast<std::size_t>(row.getColumn(4).getBytes());
  return {.id = {row.getColumn(0).getInt(), row.getColumn(1).getInt()},
          .revision = static_cast<std::uint64_t>(row.getColumn(2).getInt64()),
          .content_hash = static_cast<std::uint64_t>(row.getColumn(3).getInt64()),
          .encoded = std::span(bytes, bytes == nullptr ? 0 : size)};
}

/// From the seven columns that begin at this one.
TileRowSummary tile_row_summary(const SQLite::Statement& row, int column) {
  TileRowSummary summary;
  summary.voxel_count = row.getColumn(column).getUInt();
  for (int axis = 0; axis < 3; ++axis) {
    summary.bounds_map.min()[axis] = row.getColumn(column + 1 + axis).getDouble();
    summary.bounds_map.max()[axis] = row.getColumn(column + 4 + axis).getDouble();
  }
  return summary;
}

bool agree(const Tile& tile, const TileRowSummary& summary, const MapRow& map) {
  // Means are stored in a finer grid than the voxels'.
  const double slack_m = 0.1 * map.voxel_size_m;
  const Eigen::AlignedBox3d bounds_map = tile.info.bounds_map.cast<double>();
  return summary.voxel_count == tile.voxels.size() &&
         (tile.voxels.size() == 0 ||
          ((summary.bounds_map.min() - bounds_map.min()).cwiseAbs().maxCoeff() < slack_m &&
           (summary.bounds_map.max() - bounds_map.max()).cwiseAbs().maxCoeff() < slack_m));
}

void check_tile(const TileRow& row, const std::optional<TileRowSummary>& summary, const MapRow& map,
                MapCheck& check) {
  try {
    const Tile tile = decode_tile(row.encoded, {map.voxel_size_m, map.tile_size_m});
    check.voxels += tile.voxels.size();
    std::vector<std::string> faults = tile_faults(tile, row, map);
    if (summary && !agree(tile, *summary, map))
      faults.emplace_back("does not agree with its row's number of voxels or bounds");
    for (const std::string& what : faults) check.faults.push_back({"tile", row.id, what});
    if (faults.empty()) ++check.sound_tiles;
  } catch (const TileCodecError& error) {
    check.faults.push_back({"tile", row.id, error.what()});
  }
}

std::size_t count_tiles(SQLite::Database& database) {
  return static_cast<std::size_t>(database.execAndGet("SELECT count(*) FROM tiles").getInt64());
}

/// Without the map's sizes tiles are counted and not read.
void check_tiles(SQLite::Database& database, const std::optional<MapRow>& map, MapCheck& check,
                 const CheckProgress& progress) {
  const std::size_t total = count_tiles(database);
  const bool has_summaries = !has_first_schema(database);
  SQLite::Statement row(database,
                        std::string("SELECT x, y, revision, content_hash, encoded") +
                            (has_summaries ? ", voxel_count, min_x, min_y, min_z, max_x, max_y, "
                                             "max_z"
                                           : "") +
                            " FROM tiles ORDER BY x, y");
  while (row.executeStep()) {
    std::optional<TileRowSummary> summary;
    if (has_summaries) summary = tile_row_summary(row, 5);
    if (map) check_tile(tile_row(row), summary, *map, check);
    ++check.tiles;
    if (progress) progress(check.tiles, total);
  }
}

void check_evidence(TileId id, std::span<const std::uint8_t> encoded, std::int64_t shown,
                    const MapRow& map, MapCheck& check) {
  const auto fault = [&](const std::string& what) { check.faults.push_back({"tile", id, what}); };
  try {
    const TileEvidence evidence = decode_evidence(encoded, {map.voxel_size_m, map.tile_size_m});
    check.hidden_voxels += evidence.hidden.size() + evidence.excluded.size();
    if (evidence.id != id) fault("has the evidence of another tile");
    if (std::ssize(evidence.shown) != shown) {
      fault("shows " + std::to_string(shown) + " voxels and has evidence of " +
            std::to_string(evidence.shown.size()));
    }
  } catch (const TileCodecError& error) {
    fault(std::string("evidence ") + error.what());
  }
}

void check_tile_evidence(SQLite::Database& database, const MapRow& map, MapCheck& check) {
  if (has_first_schema(database)) return;
  SQLite::Statement row(database,
                        "SELECT m.x, m.y, m.encoded, coalesce(t.voxel_count, 0) FROM memories m "
                        "LEFT JOIN tiles t ON t.x = m.x AND t.y = m.y");
  while (row.executeStep()) {
    const SQLite::Column blob = row.getColumn(2);
    const auto* bytes = static_cast<const std::uint8_t*>(blob.getBlob());
    const auto size = static_cast<std::size_t>(blob.getBytes());
    check_evidence({row.getColumn(0).getInt(), row.getColumn(1).getInt()},
                   std::span(bytes, bytes == nullptr ? 0 : size), row.getColumn(3).getInt64(), map,
                   check);
  }
}

/// Tiles as they were before a session that may be withdrawn.
void check_session_tiles(SQLite::Database& database, const MapRow& map, MapCheck& check) {
  if (!database.tableExists("session_tiles")) return;
  MapCheck of_session;
  SQLite::Statement row(database,
                        "SELECT x, y, revision, content_hash, encoded, evidence, "
                        "coalesce(voxel_count, 0), min_x, min_y, min_z, max_x, max_y, max_z FROM "
                        "session_tiles");
  while (row.executeStep()) {
    const TileRow tile = tile_row(row);
    if (!row.isColumnNull(4)) check_tile(tile, tile_row_summary(row, 6), map, of_session);
    if (row.isColumnNull(5)) continue;
    const SQLite::Column blob = row.getColumn(5);
    check_evidence(tile.id,
                   std::span(static_cast<const std::uint8_t*>(blob.getBlob()),
                             static_cast<std::size_t>(blob.getBytes())),
                   row.getColumn(6).getInt64(), map, of_session);
  }
  for (MapFault& fault : of_session.faults) {
    fault.what = "as it was before a session: " + fault.what;
    check.faults.push_back(std::move(fault));
  }
}

void check_trajectory(SQLite::Database& database, MapCheck& check) {
  SQLite::Statement row(
      database, "SELECT stamp_ns, x, y, z, qx, qy, qz, qw FROM trajectory ORDER BY position");
  while (row.executeStep()) {
    PoseRow pose{.stamp_ns = row.getColumn(0).getInt64(), .values = {}};
    for (int i = 0; i < 7; ++i) {
      pose.values.at(static_cast<std::size_t>(i)) = row.getColumn(i + 1).getDouble();
    }
    for (const std::string& what : pose_faults(pose)) {
      check.faults.push_back(
          {"trajectory", std::nullopt, "pose " + std::to_string(check.poses) + " " + what});
    }
    ++check.poses;
  }
  // By what the file says: stamps that step back may be of a clock that was set back in one.
  check.sessions = read_sessions(database, read_trajectory(database)).size();
}

}  // namespace

MapCheck check_map_file(const std::filesystem::path& file, const CheckProgress& progress) {
  const MapFileCopy copy(file);
  MapCheck check;
  check_pages(copy, check);
  // Sound pages in a format that is refused are not a damaged map. Damaged pages are read as far as
  // possible, to find the tiles that are left.
  if (check.is_sound()) copy.check_format();
  std::optional<MapRow> map;
  guarded(check, "tiles", [&] {
    SQLite::Database database(copy.path().string());
    map = check_map_row(database, count_tiles(database), check);
    check_tiles(database, map, check, progress);
  });
  guarded(check, "tiles", [&] {
    SQLite::Database database(copy.path().string());
    if (!map || !has_usable_sizes(*map)) return;
    check_tile_evidence(database, *map, check);
    check_session_tiles(database, *map, check);
  });
  guarded(check, "trajectory", [&] {
    SQLite::Database database(copy.path().string());
    check_trajectory(database, check);
  });
  return check;
}

}  // namespace stillmap
