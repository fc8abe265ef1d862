#pragma once

#include <SQLiteCpp/Database.h>

#include <filesystem>

namespace stillmap {

/// SQLite's file with this suffix ("-wal", "-shm") beside a database.
[[nodiscard]] std::filesystem::path beside(const std::filesystem::path& file, const char* suffix);

/// Opens the SQLite database of a map file, made with an empty schema when there is no file yet.
/// A file that is not a sound map file of this schema or the one before is refused (MapFileError)
/// before anything could write to it.
[[nodiscard]] SQLite::Database open_map_database(const std::filesystem::path& file);

/// Whether the tables are those of the first schema, which stores only the voxels that tiles show.
[[nodiscard]] bool has_first_schema(SQLite::Database& database);

/// Upgrades them to the current schema, in one transaction. Throws SQLite::Exception, or
/// TileCodecError for a tile that cannot be read.
void upgrade_schema(SQLite::Database& database);

}  // namespace stillmap
