#include "core/map/storage/shown_map.hpp"

#include <SQLiteCpp/Database.h>

#include <future>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_tables.hpp"
#include "core/map/storage/read_lease.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

using Open = SQLite::Database (*)(const fs::path&);

SavedMap shown_in(const fs::path& file, Open open) {
  SQLite::Database database = open(file);
  // Reading the rows is as little for more than one core. Where no thread can be had, afterwards.
  std::future<void> checked = std::async(std::launch::async | std::launch::deferred, [&] {
    SQLite::Database other = open(file);
    check_shown_tables(other, file);
  });
  SavedMap map{read_map_row(database), {}, read_trajectory(database), read_metadata(database)};
  map.view.tiles = TileTable(read_tiles(database, map.view));
  checked.get();
  return map;
}

/// Errors are those of `file`.
SavedMap shown_of(const fs::path& file, const fs::path& opened, Open open) {
  try {
    return shown_in(opened, open);
  } catch (const MapFileError& error) {
    throw error_of(file, opened, error);
  } catch (const std::runtime_error& fault) {
    throw MapFileError(file, std::string("is damaged: ") + fault.what() +
                                 "; 'stillmap map-check' names every fault");
  }
}

/// What a program that writes to the file, or did, may not have brought into it.
bool has_log(const fs::path& file) {
  std::error_code unreadable;
  return fs::exists(beside(file, "-wal"), unreadable) || unreadable;
}

struct ReadInPlace {
  SavedMap map;
  FileState state;
};

/// Nothing where it is not certain that the file alone is the map, and stays so.
std::optional<ReadInPlace> read_in_place(const fs::path& file) {
  const fs::path real = real_file(file);
  const std::optional<ReadLease> lease = ReadLease::take(real);
  if (!lease || has_log(real) || !is_map_file(real)) return std::nullopt;
  const auto is_certain = [&] { return lease->is_unbroken(real) && !has_log(real); };
  try {
    ReadInPlace read{shown_of(file, real, open_map_in_place), lease->state()};
    if (is_certain()) return read;
  } catch (const MapFileError&) {
    // What was written to meanwhile looks damaged.
    if (is_certain()) throw;
  }
  return std::nullopt;
}

TileEvidenceMap evidence_of(const fs::path& file, const FileState& state) {
  const auto check = [&] {
    const fs::path real = real_file(file);
    const auto now = FileState::of(real);
    if (!now || (*now == state && !has_log(real))) return;
    throw MapFileError(file,
                       "has been changed since it was opened, or a server has it open by now; "
                       "open it again");
  };
  check();
  SavedMap map = read_map_file(file);
  check();
  return std::move(map.tile_evidence);
}

}  // namespace

ShownMap read_shown_map(const fs::path& file) {
  if (std::optional<ReadInPlace> read = read_in_place(file)) {
    return {std::move(read->map),
            [file = fs::absolute(file), state = read->state] { return evidence_of(file, state); }};
  }
  const auto copy = std::make_shared<const MapFileCopy>(file);
  return {shown_of(file, copy->path(), open_map_copy),
          [copy] { return copy->load().tile_evidence; }};
}

}  // namespace stillmap
