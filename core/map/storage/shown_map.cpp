#include "core/map/storage/shown_map.hpp"

#include <SQLiteCpp/Database.h>

#include <future>
#include <memory>
#include <optional>
#include <string>

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

/// Nothing where it is not certain that the file alone is the map, and stays so.
std::optional<SavedMap> read_in_place(const fs::path& file) {
  const fs::path real = real_file(file);
  const std::optional<ReadLease> lease = ReadLease::take(real);
  if (!lease || fs::exists(beside(real, "-wal")) || !is_map_file(real)) return std::nullopt;
  SavedMap map = shown_of(file, real, open_map_in_place);
  if (!lease->is_unbroken(real)) return std::nullopt;
  return map;
}

TileEvidenceMap evidence_of(const fs::path& file, std::uint64_t map_id, std::uint64_t version) {
  SavedMap map = read_map_file(file);
  if (map.view.map_id == map_id && map.view.version == version) return map.tile_evidence;
  throw MapFileError(file, "has been changed since it was opened (version " +
                               std::to_string(version) + ", now " +
                               std::to_string(map.view.version) + "); open it again");
}

}  // namespace

ShownMap read_shown_map(const fs::path& file) {
  if (std::optional<SavedMap> map = read_in_place(file)) {
    const auto evidence = [file = fs::absolute(file), map_id = map->view.map_id,
                           version = map->view.version] {
      return evidence_of(file, map_id, version);
    };
    return {std::move(*map), evidence};
  }
  const auto copy = std::make_shared<const MapFileCopy>(file);
  return {shown_of(file, copy->path(), open_map_copy),
          [copy] { return copy->load().tile_evidence; }};
}

}  // namespace stillmap
