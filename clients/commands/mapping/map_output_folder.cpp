#include "clients/commands/mapping/map_output_folder.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "core/dataset/dataset_error.hpp"
#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_file.hpp"

namespace stillmap::cli {
namespace {

namespace fs = std::filesystem;

/// The map first.
constexpr std::array result_names{"map.stillmap",
                                  "map.ply",
                                  "map.pcd",
                                  "map.png",
                                  "poses_tum.txt",
                                  "report.json",
                                  "poses_lidar.txt",
                                  "poses_base.txt",
                                  "poses_odometry.txt",
                                  "trajectory.png",
                                  "trajectory_error.png",
                                  "loops_before.png",
                                  "loops_after.png"};
/// Those that not every run has.
constexpr auto may_be_left_out = std::span(result_names).last(7);

void make(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw DatasetError(folder, "cannot be made: " + error.message());
}

/// Whether an earlier run has saved anything there. Throws MapFileError for a file that does not
/// tell: what cannot be read today may be there tomorrow.
bool holds_run(const fs::path& run_file) {
  return fs::exists(run_file) && open_map_file(run_file)->holds_map();
}

/// Whether a run left the folder, which keeps a file of that name or one beside it from the start;
/// or nothing is there.
bool is_of_run(const fs::path& unfinished, const std::string& run_name) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(unfinished, error))) return true;
  fs::directory_iterator entries(unfinished, error);
  if (error) return false;
  const bool is_empty = entries == fs::directory_iterator();
  return is_empty || std::any_of(begin(entries), end(entries), [&](const auto& entry) {
           return entry.path().filename().string().starts_with(run_name);
         });
}

/// What a run would replace in the folder.
std::optional<fs::path> result_in(const fs::path& folder) {
  for (const char* const name : result_names) {
    std::error_code not_there;
    if (fs::exists(fs::symlink_status(folder / name, not_there))) return folder / name;
  }
  return std::nullopt;
}

void check(const fs::path& folder, const fs::path& run_file, const OutputPolicy& policy) {
  if (policy.force && policy.resume) {
    throw std::invalid_argument("--force begins anew and --resume goes on: give one of them");
  }
  if (!is_of_run(run_file.parent_path(), run_file.filename().string())) {
    throw std::invalid_argument(run_file.parent_path().string() +
                                " is where a run is kept until it is finished, and is or holds "
                                "other files: move them, or choose another --out");
  }
  const bool has_run = !policy.force && holds_run(run_file);
  if (policy.resume) {
    if (has_run) return;
    throw std::invalid_argument(run_file.string() +
                                " is not there: there is no run to resume; leave out --resume");
  }
  if (policy.force) return;
  if (has_run) {
    throw std::invalid_argument(run_file.string() +
                                " is of a run that was not finished: --resume to go on with it, "
                                "or --force to begin anew");
  }
  if (const auto result = result_in(folder)) {
    throw std::invalid_argument(result->string() +
                                " exists already: choose another --out, or --force to replace it");
  }
}

}  // namespace

MapOutputFolder::MapOutputFolder(fs::path folder, const OutputPolicy& policy)
    : folder_(std::move(folder)), unfinished_(folder_ / "unfinished") {
  const fs::path map_file = folder_ / "map.stillmap";
  check(folder_, run_file(), policy);
  make(folder_);
  lock_ = std::make_unique<MapLock>(map_file);
  remove_useless_fresh_files(map_file);
  // Another run may have ended before the lock was taken.
  check(folder_, run_file(), policy);
  had_map_ = fs::exists(map_file);
  std::error_code error;
  if (!policy.resume) fs::remove_all(unfinished_, error);
  if (error) throw DatasetError(unfinished_, "cannot be removed: " + error.message());
  make(unfinished_);
}

MapOutputFolder::~MapOutputFolder() {
  try {
    if (holds_run(run_file())) return;
  } catch (const MapFileError&) {
    // A full disk, say: hours of work are not thrown away for that.
    return;
  }
  std::error_code ignored;
  fs::remove_all(unfinished_, ignored);
}

void MapOutputFolder::discard_run() {
  std::error_code ignored;
  fs::remove_all(unfinished_, ignored);
}

void MapOutputFolder::publish(bool keep_run) {
  replace_map_file(new_map_file(), folder_ / new_map_file().filename());
  std::error_code error;
  const std::string run_name = run_file().filename().string();
  std::vector<fs::path> written;
  for (const fs::directory_entry& entry : fs::directory_iterator(unfinished_, error)) {
    const bool is_state = entry.path().filename().string().starts_with(run_name);
    // A folder is what a killed run left of a map file.
    if (!is_state && !entry.is_directory()) written.push_back(entry.path());
  }
  // Pictures and poses of an earlier run would be taken for this one's; without a map, they are of
  // none.
  for (const char* const name : may_be_left_out) {
    if (had_map_ && !fs::exists(unfinished_ / name)) fs::remove(folder_ / name, error);
  }
  for (const fs::path& result : written) {
    fs::rename(result, folder_ / result.filename(), error);
    if (error) throw DatasetWriteError(result, "cannot be moved to its place: " + error.message());
  }
  if (!keep_run) fs::remove_all(unfinished_, error);
}

}  // namespace stillmap::cli
