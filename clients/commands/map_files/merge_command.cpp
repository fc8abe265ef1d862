#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>

#include "clients/commands/command.hpp"
#include "clients/commands/mapping/earlier_map.hpp"
#include "clients/commands/mapping/map_report.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/server_config.hpp"
#include "core/map/map_id.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_lock.hpp"
#include "core/map/storage/map_sessions.hpp"
#include "core/session/common_drive.hpp"
#include "core/session/map_merge.hpp"

namespace stillmap::cli {
namespace {

struct MergeArguments {
  std::string map;
  std::string other;
  std::string out;
  std::string config_file;
  bool force = false;
  bool json = false;
};

std::string sizes_of(const SavedMap& map) {
  std::ostringstream words;
  words << "voxels of " << map.view.voxel_size_m << " m in tiles of " << map.view.tile_size_m
        << " m";
  return words.str();
}

/// Throws std::invalid_argument for a file that must not be written.
void check_out(const MergeArguments& arguments) {
  for (const std::string& given : {arguments.map, arguments.other}) {
    std::error_code not_there;
    if (std::filesystem::equivalent(given, arguments.out, not_there)) {
      throw std::invalid_argument(
          arguments.out + " is one of the maps, which stay as they are: " + "name another --out");
    }
  }
  if (!std::filesystem::exists(arguments.out)) return;
  if (!arguments.force) {
    throw std::invalid_argument(arguments.out +
                                " exists already: choose another --out, or --force to replace it");
  }
  if (!std::filesystem::is_regular_file(arguments.out)) {
    throw std::invalid_argument(arguments.out + " is not a file: choose another --out");
  }
}

/// Of the pose at this position of the map's path.
std::string session_at(const EarlierMap& map, std::size_t pose) {
  for (const MapSession& session : map.sessions()) {
    if (pose < session.first_pose || pose - session.first_pose >= session.poses) continue;
    return "session " + std::to_string(session.number) +
           (session.source.empty() ? "" : " (" + session.source + ")");
  }
  return "a part";
}

/// Throws std::invalid_argument where what one map is of is in the other one: it would count twice.
void check_apart(const EarlierMap& map, const EarlierMap& other) {
  const auto throw_shared = [&](const std::string& what) {
    throw std::invalid_argument(other.file().string() + " has " + what + " of " +
                                map.file().string() +
                                " in it, whose evidence would count twice: name maps of other "
                                "drives, or withdraw it from one of them ('stillmap sessions')");
  };
  // A map of several sessions is one session of what it was merged into.
  if (const auto stretch = common_stretch(map.saved().trajectory.to_vector(),
                                          other.saved().trajectory.to_vector())) {
    throw_shared(session_at(map, stretch->first_a + stretch->poses / 2));
  }
  // Maps of before they had ids have 0.
  const std::uint64_t id = map.saved().view.map_id;
  if (id != 0 && id == other.saved().view.map_id) throw_shared("the map");
}

/// The other map, its sizes those of the first. Throws what EarlierMap throws.
std::unique_ptr<const EarlierMap> other_map(const MergeArguments& arguments,
                                            const EarlierMap& map) {
  auto other = std::make_unique<const EarlierMap>(arguments.other, std::nullopt);
  if (sizes_of(map.saved()) != sizes_of(other->saved())) {
    throw std::invalid_argument(arguments.other + " has " + sizes_of(other->saved()) + ", and " +
                                arguments.map + " has " + sizes_of(map.saved()) +
                                ": maps of one size can be merged; map one drive anew (static_map "
                                "of --config)");
  }
  if (other->saved().trajectory.empty()) {
    throw std::invalid_argument(arguments.other +
                                " has no path: what could be seen along it is what it would be "
                                "recognised by; name it first, and the other map second");
  }
  check_apart(map, *other);
  return other;
}

/// "B.stillmap (monday, tuesday)".
std::string source_of(const EarlierMap& map) {
  std::string names;
  for (const MapSession& session : map.sessions()) {
    if (!session.source.empty()) names += (names.empty() ? "" : ", ") + session.source;
  }
  return map.file().string() + (names.empty() ? "" : " (" + names + ")");
}

void save_merged(const MergeArguments& arguments, const EarlierMap& map, const EarlierMap& other,
                 const SavedMap& merged, std::int64_t clock_offset_ns, std::size_t closures) {
  try {
    // Between the two it is a whole map, but of the first one alone.
    const FreshMapFile fresh(arguments.out, FreshMapFile::Writing::in_steps);
    map.copy_to(fresh.path());
    add_map_session(
        fresh.path(), merged,
        {.source = source_of(other), .clock_offset_ns = clock_offset_ns, .closures = closures});
    replace_map_file(fresh.path(), arguments.out);
  } catch (const MapFileWriteError& error) {
    throw MapFileWriteError(arguments.out, std::string("cannot be written (") + error.what() + ")");
  }
}

ExitCode run(const MergeArguments& arguments) {
  end_cleanly_when_stopped();
  // Until the result is written, nobody else puts a map there.
  const MapLock lock(arguments.out);
  remove_useless_fresh_files(arguments.out);
  check_out(arguments);
  const StaticMapConfig rule = arguments.config_file.empty()
                                   ? StaticMapConfig{}
                                   : load_server_config(arguments.config_file).mapper.static_map;
  const auto began = std::chrono::steady_clock::now();
  const EarlierMap map(arguments.map, std::nullopt);
  const auto other = other_map(arguments, map);
  const MapAlignment alignment = align_maps(map.index(), *other->index(), other->saved().trajectory,
                                            map.saved().view.voxel_size_m);
  if (!alignment.is_recognized()) {
    throw MapNotRecognized(arguments.other + " was not recognised in " + arguments.map + ": " +
                           alignment.in_words() +
                           "; nothing was written. Maps are merged where their paths come through "
                           "the same place for some 50 m");
  }
  const std::int64_t clock_offset_ns = map.clock_offset_ns(
      std::ranges::min(other->saved().trajectory, {}, &StampedPose::stamp_ns).stamp_ns);
  SavedMap merged =
      merged_map(map.saved(), other->saved(), alignment.T_map_lidar, clock_offset_ns, rule);
  merged.view.map_id = new_map_id();
  merged.metadata = map.saved().metadata;
  save_merged(arguments, map, *other, merged, clock_offset_ns, alignment.closures.size());
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  if (arguments.json) {
    Json report = to_json(SessionReport{alignment, clock_offset_ns, seconds});
    report.set("changed_tiles", merged.tile_evidence.size());
    report.set("file", arguments.out);
    std::cout << report.dump(2) << "\n";
  } else {
    std::cout << arguments.other << " lies in " << arguments.map << ": " << alignment.in_words()
              << "\n"
              << merged.tile_evidence.size() << " tiles have voxels of it; written to "
              << arguments.out << " in " << fixed(seconds, 1) << " s\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_merge_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<MergeArguments>();
  CommandHandle command = program.command(
      "merge", "Put one map into another one of the same place, with no prior where it lies");
  command.option("MAP", arguments->map, "A map file; the result is in its frame").required();
  command.option("OTHER", arguments->other, "Another map file, made apart; it needs its path")
      .required();
  command.option("--out,--output,-o", arguments->out, "Where the map of both is written")
      .required();
  command.option("--config", arguments->config_file,
                 "Server file that the maps were made with: when a voxel is shown (static_map) is "
                 "in no map");
  command.flag("--force", arguments->force, "Replace the file --out where it exists");
  command.flag("--json", arguments->json, "Print JSON: where the maps were joined");
  command.explain(
      "Examples:\n"
      "  stillmap merge north.stillmap south.stillmap --out city.stillmap\n"
      "  stillmap merge a.stillmap b.stillmap --out c.stillmap --json | jq "
      "'.closures[].T_map_lidar'\n"
      "What could be seen along the path of OTHER is looked for in MAP, place by place until some "
      "agree, then stretch by stretch of 25 m; each voxel moves with the pose that saw it last. "
      "Both files are only read; voxels must have one size. What one of the maps alone has stays: "
      "a map does not tell where its lidar saw free space. To bring a map up to date, put the "
      "newer recording onto it ('stillmap map --onto'). OTHER is a session of the result, which "
      "'stillmap sessions' can withdraw. Exit code 5: it was not recognised, and nothing was "
      "written.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
