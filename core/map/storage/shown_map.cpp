#include "core/map/storage/shown_map.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_tables.hpp"

namespace stillmap {

SavedMap read_shown_map(const MapFileCopy& copy) {
  // Refuses what is no map file, in the words of the file itself.
  copy.check_format();
  try {
    SQLite::Database database = connect_to_map_database(copy.path());
    SavedMap map{read_map_row(database), {}, read_trajectory(database), read_metadata(database)};
    map.view.tiles = TileTable(read_tiles(database, map.view));
    return map;
  } catch (const std::runtime_error& fault) {
    throw MapFileError(copy.path(), std::string("is damaged: ") + fault.what() +
                                        "; 'stillmap map-check' names every fault");
  }
}

}  // namespace stillmap
