#include <algorithm>
#include <array>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/query/fetch_map.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/map/query/region.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/picture/map_change_picture.hpp"

namespace stillmap::cli {
namespace {

struct RemovedArguments {
  std::string map_file;
  ClientArguments client;
  RegionArguments region;
  std::string picture;
  std::string restore;
  bool json = false;
};

/// The removed voxels, and the map that they were removed from.
struct RemovedResult {
  std::vector<RemovedVoxel> voxels;
  std::uint64_t total = 0;
  std::string incomplete;
  MapSnapshot view;
};

constexpr std::array reasons{RemovalReason::moving, RemovalReason::semi_static,
                             RemovalReason::seen_through, RemovalReason::relabelled};

RemovedResult removed_in_file(const RemovedArguments& arguments) {
  SavedMap map = read_map_file(arguments.map_file);
  const Eigen::Vector3d last_map = map.trajectory.empty()
                                       ? Eigen::Vector3d(0.0, 0.0, 0.0)
                                       : map.trajectory.back().T_map_lidar.translation();
  const RegionShape region(region_at(arguments.region, last_map.head<2>()));
  RemovedResult found;
  for (const auto& [id, evidence] : map.tile_evidence) {
    for (const RemovedVoxel& voxel :
         removed_voxels(*evidence, map.view.voxel_size_m, map.view.tile_size_m)) {
      if (region.contains(voxel.position_map.cast<double>())) found.voxels.push_back(voxel);
    }
  }
  found.total = found.voxels.size();
  found.view = std::move(map.view);
  return found;
}

RemovedResult removed_on_server(Client& client, const RemovedArguments& arguments) {
  const Region region = region_of(arguments.region, client, arguments.client.timeout());
  RemovedVoxels removed = client.get_removed(region);
  RemovedResult found{std::move(removed.voxels), removed.total, std::move(removed.incomplete), {}};
  if (!arguments.picture.empty()) found.view = client.get_map();
  return found;
}

Json to_json(const RemovedResult& found) {
  Json counts;
  for (const RemovalReason reason : reasons) {
    counts.set(std::string(name(reason)),
               std::ranges::count(found.voxels, reason, &RemovedVoxel::reason));
  }
  Json json{{"total", found.total}, {"shown", found.voxels.size()}, {"reasons", counts}};
  if (!found.incomplete.empty()) json.set("incomplete", found.incomplete);
  return json;
}

std::string describe(const RemovedResult& found) {
  std::string text = std::to_string(found.total) + " voxels are kept out of the static map";
  if (found.total > found.voxels.size()) {
    text.append("; of the first ").append(std::to_string(found.voxels.size()));
  }
  for (const RemovalReason reason : reasons) {
    const auto count = std::ranges::count(found.voxels, reason, &RemovedVoxel::reason);
    text.append("\n  ").append(name(reason)).append(": ").append(std::to_string(count));
  }
  if (!found.incomplete.empty()) text.append("\nthere may be more: ").append(found.incomplete);
  return text + "\n";
}

RemovalReason reason_from_name(const std::string& text) {
  for (const RemovalReason reason : reasons) {
    if (name(reason) == text) return reason;
  }
  throw std::invalid_argument("--restore '" + text +
                              "' is no reason; it may be moving, semi-static, 'seen through' or "
                              "relabelled");
}

/// Throws std::invalid_argument for options that do not go with --restore: nobody shows the whole
/// map's removed voxels again by leaving out the box.
void check_restore(const RemovedArguments& arguments) {
  static_cast<void>(reason_from_name(arguments.restore));
  if (!arguments.map_file.empty())
    throw std::invalid_argument("--restore needs a server; leave MAPFILE out");
  const RegionArguments& region = arguments.region;
  if (region.box.empty() && region.around.empty() && region.around_robot_m == 0.0) {
    throw std::invalid_argument("--restore " + arguments.restore +
                                " needs the box to restore: give --box, --around or "
                                "--around-robot");
  }
  if (!arguments.picture.empty()) {
    throw std::invalid_argument("--picture " + arguments.picture +
                                " shows what is removed and goes not with --restore; draw it "
                                "before or after");
  }
}

ExitCode restore(Client& client, const RemovedArguments& arguments) {
  const Region region = region_of(arguments.region, client, arguments.client.timeout());
  const std::uint64_t restored =
      client.restore_removed(reason_from_name(arguments.restore), std::get<BoxRegion>(region));
  if (arguments.json) {
    std::cout << Json{{"restored", restored}}.dump(2) << "\n";
  } else {
    std::cout << restored << " voxels are shown again\n";
  }
  return ExitCode::ok;
}

ExitCode run(const RemovedArguments& arguments) {
  end_cleanly_when_stopped();
  check_region(arguments.region);
  if (!arguments.restore.empty()) check_restore(arguments);
  std::optional<Client> client;
  if (arguments.map_file.empty()) client.emplace(connect(arguments.client));
  if (!arguments.restore.empty()) return restore(*client, arguments);
  const RemovedResult found =
      client ? removed_on_server(*client, arguments) : removed_in_file(arguments);
  if (!arguments.picture.empty()) {
    write_removed_picture(arguments.picture, found.view, found.voxels);
  }
  std::cout << (arguments.json ? to_json(found).dump(2) + "\n" : describe(found));
  return ExitCode::ok;
}

}  // namespace

void add_removed_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<RemovedArguments>();
  CommandHandle command = program.command(
      "removed", "Voxels that are kept out of the static map, by reason; can restore them");
  command.option("MAPFILE,--map", arguments->map_file, "A map file instead of a server");
  add_region_options(command, arguments->region);
  command
      .option("--picture", arguments->picture,
              "Write a PNG: the map in grey, what was removed by reason")
      .ends_in(".png");
  command.option("--restore", arguments->restore,
                 "Have the server show again what was removed for this reason in the box of --box, "
                 "--around or --around-robot: moving, semi-static, 'seen through' or relabelled");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "moving: only things that were seen moving were there. semi-static: things that stood, but\n"
      "can move. seen through: rays passed its place, before it came or later. relabelled: shown\n"
      "once, but later scans took it for something that can move.\n"
      "Examples:\n"
      "  stillmap removed city_map/map.stillmap --picture removed.png\n"
      "  stillmap removed --around-robot 60 --json\n"
      "  stillmap removed --box 10 -5 -2 20 5 3 --restore 'seen through'");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
