#pragma once

#include <SQLiteCpp/Database.h>

#include <cstdint>
#include <filesystem>

namespace stillmap {

/// Files up to here are checked page by page whenever they are opened, in a tenth of a second.
inline constexpr std::uintmax_t max_checked_bytes = std::uintmax_t{64} << 20;

/// SQLite's file with this suffix ("-wal", "-shm") beside a database.
[[nodiscard]] std::filesystem::path beside(const std::filesystem::path& file, const char* suffix);

/// Opens the SQLite database of a map file, made with an empty schema when there is no file yet.
/// A file that is not a map file of this schema or the one before is refused (MapFileError) before
/// anything could write to it, and so is a damaged one of up to `max_checked_bytes`; of a larger
/// one what is damaged is found when it is read.
[[nodiscard]] SQLite::Database open_map_database(const std::filesystem::path& file);

/// Whether the tables are those of the first schema, which stores only the voxels that tiles show.
[[nodiscard]] bool has_first_schema(SQLite::Database& database);

/// Upgrades them to the current schema, in one transaction. Throws SQLite::Exception, or
/// TileCodecError for a tile that cannot be read.
void upgrade_schema(SQLite::Database& database);

/// Makes the index from which `read_tile_infos` reads where it is missing: files of earlier
/// versions have none. Programs that do not know it keep it up to date. Throws SQLite::Exception.
void index_tile_infos(SQLite::Database& database);

}  // namespace stillmap
