#include <cmath>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "clients/commands/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/map_snapshot.hpp"
#include "clients/commands/query_region.hpp"
#include "clients/commands/stage_times.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/text.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "core/map/map_picture.hpp"

namespace stillmap {
namespace {

struct Arguments {
  ClientArguments client;
  RegionArguments region;
  std::vector<std::string> classes;
  double resolution_m = 0.0;
  std::string out;
  std::string picture;
  std::uint64_t repeat = 1;
  bool json = false;
};

std::bitset<semantic_class_count> classes_of(const std::vector<std::string>& names) {
  std::bitset<semantic_class_count> classes;
  for (const std::string& class_name : names) {
    const std::optional<SemanticClass> label = class_from_name(class_name);
    if (!label) {
      std::string known;
      for (std::size_t k = 0; k < semantic_class_count; ++k) {
        known.append(" ").append(name(static_cast<SemanticClass>(k)));
      }
      throw std::invalid_argument("class '" + class_name + "' is not known; there are:" + known);
    }
    classes.set(static_cast<std::size_t>(*label));
  }
  return classes;
}

void check_out_name(const std::string& file) {
  if (file.empty() || file.ends_with(".pcd") || file.ends_with(".ply")) return;
  throw std::invalid_argument("--out " + file + ": the name must end in .pcd or .ply");
}

void write_cloud(const std::string& file, const std::vector<QueryVoxel>& voxels) {
  std::vector<ColouredPoint> points;
  points.reserve(voxels.size());
  for (const QueryVoxel& voxel : voxels) {
    points.push_back({voxel.position_map, voxel.label, voxel.confidence});
  }
  file.ends_with(".pcd") ? write_pcd(file, points) : write_ply(file, points);
}

// The whole map with the path and the outline of what was asked for.
void draw_query(const std::string& file, Client& client, const Eigen::AlignedBox3d& box_map,
                std::chrono::milliseconds timeout) {
  MapPictureOptions options;
  options.query_box_map = box_map;
  write_map_picture(file, fetch_map(client), newest_path(client, timeout), options);
}

struct Answer {
  Eigen::AlignedBox3d box_map;
  MapQueryResult result;
  /// Of every time it was asked, all pages together.
  StageTime times;
};

Answer ask(Client& client, const Arguments& arguments,
           const std::bitset<semantic_class_count>& classes) {
  MapQuery query;
  query.box_map = box_of(arguments.region, client, arguments.client.timeout());
  query.classes = classes;
  query.resolution_m = arguments.resolution_m;
  Answer answer{query.box_map, {}, {.stage = "query", .ms = {}}};
  Progress progress("query", "voxels", 0);
  while (answer.times.ms.size() < arguments.repeat) {
    const auto began = std::chrono::steady_clock::now();
    answer.result =
        client.get_whole_static_map(query, [&](std::uint64_t arrived, std::uint64_t total) {
          progress.update(arrived, "of " + std::to_string(total));
        });
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
    if (answer.result.status != QueryStatus::ok) throw std::invalid_argument(answer.result.reason);
    answer.times.ms.push_back(took.count());
  }
  return answer;
}

std::map<SemanticClass, std::uint64_t> count_by_class(const std::vector<QueryVoxel>& voxels) {
  std::map<SemanticClass, std::uint64_t> counts;
  for (const QueryVoxel& voxel : voxels) counts[voxel.label] += 1;
  return counts;
}

nlohmann::json to_json(const Answer& answer) {
  nlohmann::json by_class = nlohmann::json::object();
  for (const auto& [label, count] : count_by_class(answer.result.voxels)) {
    by_class[std::string(name(label))] = count;
  }
  const auto corner = [](const Eigen::Vector3d& p) {
    nlohmann::json json = nlohmann::json::array();
    for (const double value : p) {
      json.push_back(std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(nullptr));
    }
    return json;
  };
  return {
      {"voxels", answer.result.voxels.size()},
      {"classes", by_class},
      {"map_id", answer.result.map_id},
      {"map_version", answer.result.map_version},
      {"box_map", {{"min", corner(answer.box_map.min())}, {"max", corner(answer.box_map.max())}}},
      {"ms", answer.times.quantile(0.5)},
      {"p99_ms", answer.times.quantile(0.99)},
      {"asked", answer.times.ms.size()}};
}

std::string describe(const Answer& answer) {
  Table table({"class", "voxels"});
  for (const auto& [label, count] : count_by_class(answer.result.voxels)) {
    table.add({std::string(name(label)), std::to_string(count)});
  }
  return table.text() + std::to_string(answer.result.voxels.size()) + " voxels of map " +
         std::to_string(answer.result.map_id) + " version " +
         std::to_string(answer.result.map_version) + " in " + fixed(answer.times.quantile(0.5), 1) +
         " ms" +
         (answer.times.ms.size() == 1
              ? std::string("\n")
              : " (median of " + std::to_string(answer.times.ms.size()) + "; p99 " +
                    fixed(answer.times.quantile(0.99), 1) + " ms)\n");
}

ExitCode run(const Arguments& arguments) {
  check_out_name(arguments.out);
  const auto classes = classes_of(arguments.classes);
  Client client = connect(arguments.client);
  const Answer answer = ask(client, arguments, classes);
  if (!arguments.out.empty()) write_cloud(arguments.out, answer.result.voxels);
  if (!arguments.picture.empty()) {
    draw_query(arguments.picture, client, answer.box_map, arguments.client.timeout());
  }
  std::cout << (arguments.json ? to_json(answer).dump(2) + "\n" : describe(answer));
  if (!arguments.json && !arguments.out.empty()) {
    std::cout << "written to " << arguments.out << " (map frame)\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_query_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = program.command("query", "Ask the server for a region of its static map");
  add_region_options(command, arguments->region);
  command.option("--classes", arguments->classes, "Only these: road,building,traffic-sign")
      .comma_separated();
  command.option("--resolution", arguments->resolution_m,
                 "Voxel size of the answer [m]; default: the map's own");
  command.option("--out", arguments->out, "Write the voxels to FILE.pcd or FILE.ply");
  command.option("--picture", arguments->picture,
                 "Draw the whole map from above, the path and the region, to FILE.png");
  command.option("--repeat", arguments->repeat, "Ask so many times; says median and p99")
      .above_zero();
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap query --around-robot 50\n"
      "  stillmap query --box -20 -20 -3 20 20 5 --classes road,sidewalk --out ground.ply\n"
      "  stillmap query --resolution 1 --json | jq .classes\n"
      "Without a region, the whole map. Boxes are in the map frame [m].");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap
