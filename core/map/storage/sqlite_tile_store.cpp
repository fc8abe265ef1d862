#include "core/map/storage/sqlite_tile_store.hpp"

#include <SQLiteCpp/Transaction.h>
#include <sqlite3.h>

#include <cstddef>
#include <string>
#include <utility>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_tables.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// The mapper, the search for loops, the publishers of tiles and of the cloud, traversability, and
/// the six services that read tiles: none waits.
constexpr std::size_t max_readers = 11;

}  // namespace

MapFileError unreadable(const fs::path& file, const std::runtime_error& error) {
  return {file, std::string("cannot be read (") + error.what() +
                    "); restore a copy or name another file"};
}

/// A connection that no other reader has.
struct SqliteTileStore::Use {
  explicit Use(SqliteTileStore& its_store) : store(its_store) {
    std::unique_lock lock(store.mutex_);
    store.given_back_.wait(lock, [&] { return !store.idle_.empty(); });
    database = store.idle_.back();
    store.idle_.pop_back();
  }
  ~Use() {
    {
      const std::scoped_lock lock(store.mutex_);
      store.idle_.push_back(database);
    }
    store.given_back_.notify_one();
  }
  Use(const Use&) = delete;
  Use& operator=(const Use&) = delete;

  SqliteTileStore& store;
  SQLite::Database* database = nullptr;
};

SqliteTileStore::SqliteTileStore(const fs::path& file,
                                 std::shared_ptr<const TemporaryFolder> folder,
                                 std::shared_ptr<const std::atomic<bool>> is_log_abandoned)
    : folder_(std::move(folder)), file_(file), is_log_abandoned_(std::move(is_log_abandoned)) {
  connections_.reserve(max_readers);
  while (connections_.size() < max_readers) {
    connections_.push_back(connect_to_map_database(file));
  }
  for (SQLite::Database& connection : connections_) idle_.push_back(&connection);
}

SqliteTileStore::~SqliteTileStore() {
  if (is_log_abandoned_ == nullptr || !*is_log_abandoned_) return;
  for (SQLite::Database& connection : connections_)
    sqlite3_db_config(connection.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
}

TileRecord SqliteTileStore::load(TileId id) {
  const Use use(*this);
  try {
    const SQLite::Transaction one_state(*use.database);
    return read_record(*use.database, id, read_map_row(*use.database));
  } catch (const std::runtime_error& error) {
    throw unreadable(file_, error);
  }
}

}  // namespace stillmap
