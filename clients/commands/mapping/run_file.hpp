#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/map/storage/map_file.hpp"

namespace stillmap::cli {

/// How far a mapping run has come.
struct RunState {
  SavedMap map;
  /// Index in the data set of each pose of the map's path.
  std::vector<std::size_t> scan_of_pose;
  /// Index of the scan to go on with.
  std::size_t next_scan = 0;
};

/// What a run is over, and how it maps, both in words: where they differ, runs are not one.
struct RunIdentity {
  std::string dataset;
  std::string settings;
};

/// A mapping run on disk while it goes on: a map file that also says which scans are in it, so that
/// a run which was killed can be resumed.
class RunFile {
 public:
  /// Opens or makes it. Throws MapFileError.
  RunFile(std::filesystem::path file, RunIdentity run, std::chrono::duration<double> period);

  /// What an earlier run has left; nothing in a new file. Throws MapFileError, or
  /// std::invalid_argument for a run over another recording, or with other settings.
  [[nodiscard]] std::optional<RunState> earlier() const;

  /// Whether the last save is a period ago.
  [[nodiscard]] bool is_due() const { return std::chrono::steady_clock::now() >= due_; }
  /// Throws MapFileError; the last state is still there.
  void save(RunState state);

 private:
  std::filesystem::path file_;
  RunIdentity run_;
  std::chrono::duration<double> period_;
  std::unique_ptr<MapStore> store_;
  std::chrono::steady_clock::time_point due_;
};

/// Of two lists with commas between their parts: what only one of them has, of each.
[[nodiscard]] std::pair<std::string, std::string> different_parts(const std::string& one,
                                                                  const std::string& other);

/// Indices as "0-57,59": ascending; as many as there are poses.
[[nodiscard]] std::string to_ranges(const std::vector<std::size_t>& indices);
/// Nothing for text that to_ranges did not write.
[[nodiscard]] std::optional<std::vector<std::size_t>> from_ranges(const std::string& text);

}  // namespace stillmap::cli
