#pragma once

#include <SQLiteCpp/Database.h>

#include <filesystem>

namespace stillmap {

/// Opens the SQLite database of a map file, made with an empty schema when there is no file yet.
/// A file that is not a sound map file of this schema is refused (MapFileError) before anything
/// could write to it.
[[nodiscard]] SQLite::Database open_map_database(const std::filesystem::path& file);

}  // namespace stillmap
