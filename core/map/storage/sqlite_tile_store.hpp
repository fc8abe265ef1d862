#pragma once

#include <SQLiteCpp/Database.h>

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <vector>

#include "core/map/storage/map_file.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/process/temporary_folder.hpp"

namespace stillmap {

/// What reading a map file has thrown, with the remedy.
[[nodiscard]] MapFileError unreadable(const std::filesystem::path& file,
                                      const std::runtime_error& error);

/// Reads through connections of its own, so that readers wait neither for a save nor for each
/// other. All are opened at once: the file may lie under another name later, and another map under
/// this.
class SqliteTileStore : public TileStore {
 public:
  /// `folder` is kept as long as the store. Where `is_log_abandoned` has become true by the end,
  /// the last connection does not write the log into the file, which is somebody else's then.
  /// Throws MapFileError.
  explicit SqliteTileStore(const std::filesystem::path& file,
                           std::shared_ptr<const TemporaryFolder> folder = nullptr,
                           std::shared_ptr<const std::atomic<bool>> is_log_abandoned = nullptr);
  ~SqliteTileStore() override;
  SqliteTileStore(const SqliteTileStore&) = delete;
  SqliteTileStore& operator=(const SqliteTileStore&) = delete;

  TileRecord load(TileId id) override;

 private:
  struct Use;

  std::shared_ptr<const TemporaryFolder> folder_;
  std::filesystem::path file_;
  std::shared_ptr<const std::atomic<bool>> is_log_abandoned_;
  std::mutex mutex_;
  std::condition_variable given_back_;
  std::vector<SQLite::Database> connections_;
  std::vector<SQLite::Database*> idle_;
};

}  // namespace stillmap
