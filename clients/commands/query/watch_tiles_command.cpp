#include <deque>
#include <iostream>
#include <memory>
#include <mutex>
#include <utility>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/query/query_report.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"

namespace stillmap::cli {
namespace {

struct WatchTilesArguments {
  ClientArguments client;
  RegionArguments region;
  /// 0: no limit.
  std::uint64_t count = 0;
  double duration_s = 0.0;
  bool json = false;
};

/// A tile of the update, for printing.
struct TileUpdate {
  TileChange change;
  std::uint64_t map_id = 0;
  std::uint64_t map_version = 0;
};

/// Hands tiles from the subscription's thread to the printing one.
class TileUpdateQueue {
 public:
  void add(const RegionUpdate& update) {
    const std::lock_guard lock(mutex_);
    for (const Tile& tile : update.appeared) add(update, tile.info, TileChangeKind::appeared);
    for (const Tile& tile : update.changed) add(update, tile.info, TileChangeKind::changed);
    for (const TileId id : update.removed)
      add(update, {.id = id, .bounds_map = {}}, TileChangeKind::removed);
  }
  std::deque<TileUpdate> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(tiles_, {});
  }

 private:
  void add(const RegionUpdate& update, const TileInfo& info, TileChangeKind kind) {
    tiles_.push_back(
        {{info.id, kind, info.revision, info.voxel_count}, update.map.map_id, update.map.version});
  }

  std::mutex mutex_;
  std::deque<TileUpdate> tiles_;
};

void print(const TileUpdate& update, bool json) {
  const TileChange& tile = update.change;
  if (json) {
    const Json line = {
        {"type", "tile"},          {"change", name(tile.kind)},        {"x", tile.id.x},
        {"y", tile.id.y},          {"revision", tile.revision},        {"voxels", tile.voxel_count},
        {"map_id", update.map_id}, {"map_version", update.map_version}};
    std::cout << line.dump() << std::endl;
    return;
  }
  std::cout << "tile " << tile.id.x << " " << tile.id.y << " " << name(tile.kind);
  if (tile.kind != TileChangeKind::removed) {
    std::cout << ": " << tile.voxel_count << " voxels, revision " << tile.revision;
  }
  std::cout << std::endl;
}

ExitCode run(const WatchTilesArguments& arguments) {
  check_region(arguments.region);
  StopSignal stop;
  Client client = connect(arguments.client);
  const Region region = region_of(arguments.region, client, arguments.client.timeout());
  TileUpdateQueue queue;
  const Subscription subscription =
      client.subscribe_region(region, [&](const RegionUpdate& update) { queue.add(update); });
  const auto began = std::chrono::steady_clock::now();
  std::uint64_t printed = 0;
  const auto is_enough = [&] { return arguments.count > 0 && printed >= arguments.count; };
  bool time_is_up = false;
  while (!is_enough() && !time_is_up && !stop.wait_for(std::chrono::milliseconds(50))) {
    for (const TileUpdate& tile : queue.take()) {
      if (is_enough()) break;
      print(tile, arguments.json);
      ++printed;
    }
    const std::chrono::duration<double> watched = std::chrono::steady_clock::now() - began;
    time_is_up = arguments.duration_s > 0.0 && watched.count() >= arguments.duration_s;
  }
  return arguments.count > 0 && time_is_up && !is_enough() ? ExitCode::no_server : ExitCode::ok;
}

}  // namespace

void add_watch_tiles_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<WatchTilesArguments>();
  CommandHandle command = program.command(
      "watch-tiles", "Tiles of a region as they appear, change and go; no others are received");
  add_region_options(command, arguments->region);
  command.option("--count", arguments->count, "End after as many tiles");
  command.option("--duration", arguments->duration_s, "End after as many seconds").above_zero();
  command.flag("--json", arguments->json, "Print a JSON line for every tile");
  add_client_options(command, arguments->client);
  command.explain(
      "Examples:\n"
      "  stillmap watch-tiles --around 0 0 60\n"
      "  stillmap watch-tiles --corridor path.txt --width 6 --json\n"
      "Ends with Ctrl-C. Exit code 3 when no server answers, or when --duration ends before\n"
      "--count tiles came.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
