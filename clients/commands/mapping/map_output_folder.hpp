#pragma once

#include <filesystem>
#include <memory>

#include "core/map/storage/map_lock.hpp"

namespace stillmap::cli {

/// What to do about results or a run that the output folder has already.
struct OutputPolicy {
  /// Replace them.
  bool force = false;
  /// Go on with the run that was not finished.
  bool resume = false;
};

/// The folder of a mapping run's results. They are written into a folder beneath it, "unfinished",
/// and take the place of older ones only when they are complete: until then those stay.
class MapOutputFolder {
 public:
  /// Makes the folders. Throws std::invalid_argument when there is a file of a result's name or an
  /// unfinished run and the policy does not say what to do, DatasetError for a folder that cannot
  /// be made, and MapFileError when another process writes the map.
  MapOutputFolder(std::filesystem::path folder, const OutputPolicy& policy);
  /// Removes the unfinished folder when there is no run in it to go on with.
  ~MapOutputFolder();
  MapOutputFolder(const MapOutputFolder&) = delete;
  MapOutputFolder& operator=(const MapOutputFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return folder_; }
  /// Where results are written.
  [[nodiscard]] const std::filesystem::path& unfinished() const { return unfinished_; }
  /// The run's state, in the unfinished folder.
  [[nodiscard]] std::filesystem::path run_file() const { return unfinished_ / "run.stillmap"; }
  /// Scans that are kept until loops are closed, beside the run's state; removed with it.
  [[nodiscard]] std::filesystem::path kept_scans_file() const {
    return unfinished_ / "run.stillmap.scans";
  }
  /// The map among the results, in the unfinished folder.
  [[nodiscard]] std::filesystem::path new_map_file() const { return unfinished_ / "map.stillmap"; }
  /// Whether the folder had a map before this run.
  [[nodiscard]] bool had_map() const { return had_map_; }

  /// Removes what the run has left: it is not to be resumed.
  void discard_run();

  /// Moves the results to their place, the map first. With `keep_run`, the run can still be
  /// resumed. Throws MapFileError or DatasetError.
  void publish(bool keep_run);

 private:
  std::filesystem::path folder_;
  std::filesystem::path unfinished_;
  bool had_map_ = false;
  std::unique_ptr<MapLock> lock_;
};

}  // namespace stillmap::cli
