#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/query/fetch_map.hpp"
#include "clients/commands/query/query_report.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "core/map/query/region.hpp"
#include "core/picture/map_picture.hpp"

namespace stillmap::cli {
namespace {

struct QueryArguments {
  ClientArguments client;
  RegionArguments region;
  std::vector<std::string> classes;
  double resolution_m = 0.0;
  std::optional<std::uint64_t> since_version;
  /// 0: the server's current map.
  std::uint64_t since_map = 0;
  std::string out;
  std::string picture;
  std::uint64_t repeat = 1;
  bool json = false;
};

void check_out_name(const std::string& file) {
  if (file.empty() || is_cloud_file(file)) return;
  throw std::invalid_argument("--out " + file + ": the name must end in .pcd or .ply");
}

// The whole map with the path and the bounding box of the queried region.
void draw_query(const std::string& file, Client& client, const Region& region,
                std::chrono::milliseconds timeout) {
  MapPictureOptions options;
  options.query_box_map = RegionShape(region).bounds_map();
  write_map_picture(file, client.get_map(), fetch_trajectory(client, timeout), options);
}

std::optional<KnownVersion> since_of(const QueryArguments& arguments, Client& client) {
  if (!arguments.since_version) return std::nullopt;
  const std::uint64_t map_id =
      arguments.since_map == 0 ? client.status().map_id : arguments.since_map;
  return KnownVersion{.map_id = map_id, .version = *arguments.since_version};
}

/// The filters of the query, which can be checked without a server.
MapQuery filters_of(const QueryArguments& arguments) {
  MapQuery query;
  query.classes = classes_of(arguments.classes);
  query.resolution_m = arguments.resolution_m;
  return query;
}

QueryAnswer run_query(Client& client, const QueryArguments& arguments, const MapQuery& filters) {
  QueryAnswer answer{filters, {}, {.stage = "query", .ms = {}}};
  answer.query.region = region_of(arguments.region, client, arguments.client.timeout());
  answer.query.since = since_of(arguments, client);
  Progress progress("query", "voxels", 0);
  while (answer.times.ms.size() < arguments.repeat) {
    const auto began = std::chrono::steady_clock::now();
    answer.result =
        client.get_whole_static_map(answer.query, [&](std::uint64_t arrived, std::uint64_t total) {
          progress.update(arrived, "of " + std::to_string(total));
        });
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
    require_answer(answer.result);
    answer.times.ms.push_back(took.count());
  }
  return answer;
}

ExitCode run(const QueryArguments& arguments) {
  check_out_name(arguments.out);
  check_region(arguments.region);
  const MapQuery filters = filters_of(arguments);
  Client client = connect(arguments.client);
  const QueryAnswer answer = run_query(client, arguments, filters);
  if (!arguments.out.empty()) write_cloud(arguments.out, answer.result.voxels);
  if (!arguments.picture.empty()) {
    draw_query(arguments.picture, client, answer.query.region, arguments.client.timeout());
  }
  std::cout << (arguments.json ? to_json(answer).dump(2) + "\n" : describe(answer));
  if (!arguments.json && !arguments.out.empty()) {
    std::cout << "written to " << arguments.out << " (map frame)\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_query_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<QueryArguments>();
  CommandHandle command = program.command("query", "Query a region of the server's static map");
  add_region_options(command, arguments->region);
  command.option("--classes", arguments->classes, "Only these: road,building,traffic-sign")
      .comma_separated();
  command.option("--resolution", arguments->resolution_m,
                 "Voxel size of the answer [m]; default: the map's own");
  const OptionHandle since_version =
      command.option("--since-version", arguments->since_version,
                     "Only tiles that appeared or changed since this version; names those removed");
  command
      .option("--since-map", arguments->since_map,
              "Id of the map that the version is of; default: the server's current map, which has "
              "another id after every start of the server")
      .needs(since_version);
  command.option("--out,--output,-o", arguments->out, "Write the voxels to FILE.pcd or FILE.ply");
  command
      .option("--picture", arguments->picture,
              "Draw the whole map from above, the path and the region, to FILE.png")
      .ends_in(".png");
  command
      .option("--repeat", arguments->repeat,
              "Repeat the query so many times; prints median and p99")
      .above_zero();
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap query --around-robot 50\n"
      "  stillmap query --box -20 -20 -3 20 20 5 --classes road,sidewalk --out ground.ply\n"
      "  stillmap query --polygon 0 0 30 0 30 20 --min-z -3 --max-z 2\n"
      "  stillmap query --corridor path.txt --width 4 --out way.ply\n"
      "  stillmap query --resolution 1 --json | jq .classes\n"
      "  stillmap query --around-robot 50 --since-version 120\n"
      "Without a region, the whole map. Coordinates are in the map frame [m].");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
