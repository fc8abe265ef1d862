#pragma once

#include <SQLiteCpp/Database.h>

#include <cstdint>
#include <filesystem>
#include <string>

namespace stillmap {

/// Files up to here are checked page by page whenever they are opened, in a tenth of a second.
inline constexpr std::uintmax_t max_checked_bytes = std::uintmax_t{64} << 20;

/// SQLite's file with this suffix ("-wal", "-shm") beside a database.
[[nodiscard]] std::filesystem::path beside(const std::filesystem::path& file, const char* suffix);

/// The name by which SQLite opens this file and no other: absolute, since it takes a relative name
/// such as "file:..." for a URI, which can mean any file.
[[nodiscard]] std::string sqlite_name(const std::filesystem::path& file);

/// An SQLite URI by which the file is opened as it is alone, without its log: to be read only.
[[nodiscard]] std::string uri_without_log(const std::filesystem::path& file);

/// Opens the SQLite database of a map file, made with an empty schema when there is no file yet.
/// A file that is not a map file of this schema or the one before is refused (MapFileError) before
/// anything could write to it, and so is a damaged one of up to `max_checked_bytes`; of a larger
/// one what is damaged is found when it is read. A log beside it that belongs to another file (a
/// backup was copied over the one that a crash left) is renamed, and the file opened as it is
/// alone.
[[nodiscard]] SQLite::Database open_map_database(const std::filesystem::path& file);
/// The same of a copy that is nobody else's, whose pages are not checked yet. It is read as memory,
/// which is eight times as fast; of a file that another process may cut off, this one would die.
[[nodiscard]] SQLite::Database open_map_copy(const std::filesystem::path& file);
/// The same, for reading only, of a file under a ReadLease that has no log: nothing is locked, made
/// or written.
[[nodiscard]] SQLite::Database open_map_in_place(const std::filesystem::path& file);
/// Checks what a reader of voxels reads, and not the pages of evidence, of a file of up to
/// `max_checked_bytes`. Throws as open_map_database.
void check_shown_tables(SQLite::Database& database, const std::filesystem::path& file);
/// One more connection to a file that this process has opened so, without a look at its content.
[[nodiscard]] SQLite::Database connect_to_map_database(const std::filesystem::path& file);

/// Puts a complete and closed map file in the place of another one, or of none, in one step: after
/// a crash the old or the new one is there. Throws std::filesystem::filesystem_error.
void put_in_place(const std::filesystem::path& fresh, const std::filesystem::path& file);

/// The same for a name that no file has; false, and nothing done, where one has it by then.
[[nodiscard]] bool put_in_free_place(const std::filesystem::path& fresh,
                                     const std::filesystem::path& file);

/// Whether the tables are those of the first schema, which stores only the voxels that tiles show.
[[nodiscard]] bool has_first_schema(SQLite::Database& database);

/// Upgrades them to the current schema, in one transaction. Throws SQLite::Exception, or
/// TileCodecError for a tile that cannot be read.
void upgrade_schema(SQLite::Database& database);

/// Makes the index from which `read_tile_infos` reads where it is missing: files of earlier
/// versions have none. Programs that do not know it keep it up to date. Throws SQLite::Exception.
void index_tile_infos(SQLite::Database& database);

}  // namespace stillmap
