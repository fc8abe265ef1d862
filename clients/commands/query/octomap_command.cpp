#include <algorithm>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/occupancy/occupancy_map.hpp"
#include "core/occupancy/occupancy_query.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "core/occupancy/octomap_file.hpp"

namespace stillmap::cli {
namespace {

/// What an octree holds.
struct OctomapSummary {
  double resolution_m = 0.0;
  std::uint64_t nodes = 0;
  std::uint64_t occupied = 0;
  std::uint64_t free = 0;
  std::uint64_t encoded_bytes = 0;
};

std::string place(const Eigen::Vector3d& p) {
  return fixed(p.x(), 2) + ", " + fixed(p.y(), 2) + ", " + fixed(p.z(), 2);
}

std::string outcome(const PointOccupancy& point) {
  if (!point.fault.empty()) return "cannot be asked: " + point.fault;
  return std::string(name(point.occupancy)) + " (probability " + fixed(point.probability, 2) + ")";
}

std::string outcome(const BoxOccupancy& box) {
  if (!box.fault.empty()) return "cannot be asked: " + box.fault;
  return std::to_string(box.occupied) + " voxels occupied, " + std::to_string(box.free) +
         " free, " + std::to_string(box.unknown) + " unknown";
}

std::string outcome(const RayOccupancy& ray) {
  if (!ray.fault.empty()) return "cannot be asked: " + ray.fault;
  const std::string where = fixed(ray.length_m, 2) + " m, at " + place(ray.end_map);
  if (ray.end == Occupancy::occupied) return "hits after " + where;
  if (ray.end == Occupancy::unknown) return "enters unknown space after " + where;
  return "is free for " + where;
}

Json coordinates(const Eigen::Vector3d& p) { return Json::array({p.x(), p.y(), p.z()}); }

Json with_fault(Json answer, const std::string& fault) {
  return fault.empty() ? std::move(answer) : Json{{"fault", fault}};
}

Json one(const PointOccupancy& point) {
  return with_fault({{"occupancy", name(point.occupancy)}, {"probability", point.probability}},
                    point.fault);
}

Json one(const BoxOccupancy& box) {
  Json voxels = Json::array();
  for (const auto& voxel_map : box.occupied_map) {
    voxels.push_back(coordinates(voxel_map.cast<double>()));
  }
  return with_fault({{"occupied", box.occupied},
                     {"free", box.free},
                     {"unknown", box.unknown},
                     {"occupied_voxels", voxels}},
                    box.fault);
}

Json one(const RayOccupancy& ray) {
  return with_fault(
      {{"end", name(ray.end)}, {"length_m", ray.length_m}, {"end_point", coordinates(ray.end_map)}},
      ray.fault);
}

template <class Answer>
Json all(const std::vector<Answer>& answers) {
  Json list = Json::array();
  for (const Answer& answer : answers) list.push_back(one(answer));
  return list;
}

OctomapSummary summarize(const OctomapData& data) {
  const OccupancyMap map(data);
  const double reach_m = 32766.0 * data.resolution_m;
  const Eigen::Vector3d corner = Eigen::Vector3d::Constant(reach_m);
  const BoxOccupancy all = map.in_box({-corner, corner}, 0);
  return {.resolution_m = data.resolution_m,
          .nodes = map.size().nodes,
          .occupied = all.occupied,
          .free = all.free,
          .encoded_bytes = data.bytes.size()};
}

std::string describe(const OctomapSummary& summary) {
  std::ostringstream text;
  text << summary.occupied << " voxels occupied, " << summary.free << " free, of "
       << summary.resolution_m << " m; " << summary.nodes << " nodes in " << summary.encoded_bytes
       << " bytes\n";
  return text.str();
}

Json to_json(const OctomapSummary& summary) {
  return {{"resolution_m", summary.resolution_m},
          {"nodes", summary.nodes},
          {"occupied", summary.occupied},
          {"free", summary.free},
          {"bytes", summary.encoded_bytes}};
}

/// Every question with its answer, a line each.
std::string describe(const OccupancyQuery& query, const OccupancyAnswers& answers) {
  std::string text;
  const auto add_line = [&](const std::string& asked, const std::string& said) {
    text.append(asked).append(": ").append(said).append("\n");
  };
  for (std::size_t i = 0; i < answers.points.size(); ++i) {
    add_line("point " + place(query.points_map[i]), outcome(answers.points[i]));
  }
  for (std::size_t i = 0; i < answers.boxes.size(); ++i) {
    const Eigen::AlignedBox3d& box_map = query.boxes_map[i];
    add_line("box " + place(box_map.min()) + " to " + place(box_map.max()),
             outcome(answers.boxes[i]));
  }
  for (std::size_t i = 0; i < answers.rays.size(); ++i) {
    add_line("ray from " + place(query.rays[i].origin_map), outcome(answers.rays[i]));
  }
  return text;
}

Json to_json(const OccupancyAnswers& answers) {
  return {{"resolution_m", answers.resolution_m},
          {"points", all(answers.points)},
          {"boxes", all(answers.boxes)},
          {"rays", all(answers.rays)}};
}

struct OctomapArguments {
  ClientArguments client;
  /// Instead of a server.
  std::string map;
  /// 0: not given.
  double resolution_m = 0.0;
  std::string output;
  std::vector<double> points;
  std::vector<double> boxes;
  std::vector<double> rays;
  double max_range_m = 100.0;
  bool through_unknown = false;
  std::uint32_t max_voxels = 1000;
  bool json = false;
};

/// The numbers in groups of `size`.
std::vector<Eigen::VectorXd> groups(const std::string& option, const std::vector<double>& numbers,
                                    std::size_t size) {
  if (numbers.size() % size != 0) {
    throw std::invalid_argument(option + " has " + std::to_string(numbers.size()) +
                                " numbers; it takes " + std::to_string(size));
  }
  std::vector<Eigen::VectorXd> all;
  for (std::size_t i = 0; i < numbers.size(); i += size) {
    all.emplace_back(
        Eigen::Map<const Eigen::VectorXd>(numbers.data() + i, static_cast<Eigen::Index>(size)));
  }
  return all;
}

OccupancyQuery query_of(const OctomapArguments& arguments) {
  OccupancyQuery query;
  query.max_voxels = arguments.max_voxels;
  for (const auto& point : groups("--point", arguments.points, 3)) {
    query.points_map.emplace_back(point);
  }
  for (const auto& box : groups("--box", arguments.boxes, 6)) {
    Eigen::AlignedBox3d& box_map = query.boxes_map.emplace_back();
    box_map.min() = box.head<3>();
    box_map.max() = box.tail<3>();
  }
  for (const auto& ray : groups("--ray", arguments.rays, 6)) {
    query.rays.push_back({.origin_map = ray.head<3>(),
                          .direction_map = ray.tail<3>(),
                          .max_range_m = arguments.max_range_m,
                          .ignore_unknown = arguments.through_unknown});
  }
  return query;
}

std::size_t refused(const OccupancyAnswers& answers) {
  const auto count = [](const auto& some) {
    return std::ranges::count_if(some, [](const auto& answer) { return !answer.fault.empty(); });
  };
  return static_cast<std::size_t>(count(answers.points) + count(answers.boxes) +
                                  count(answers.rays));
}

/// The octree of a stored static map, or of a file of OctoMap's.
OccupancyMap open_map(const OctomapArguments& arguments) {
  const std::filesystem::path file = arguments.map;
  if (file.extension() == ".bt" || file.extension() == ".ot") {
    if (arguments.resolution_m != 0.0) {
      throw std::invalid_argument("--resolution is for a .stillmap map; " + arguments.map +
                                  " has a resolution of its own: leave it out");
    }
    return OccupancyMap(read_octomap_file(file));
  }
  OccupancyConfig config;
  if (arguments.resolution_m != 0.0) config.resolution_m = arguments.resolution_m;
  if (!config.faults().empty()) {
    throw std::invalid_argument("--resolution is " + fixed(config.resolution_m, 3) +
                                "; it must be " + fixed(OccupancyConfig::min_resolution_m, 2) +
                                " to " + fixed(OccupancyConfig::max_resolution_m, 0) + " m");
  }
  OccupancyMap map(config);
  const SavedMap saved = read_map_file(file);
  if (const std::size_t left_out = map.insert(saved.view); left_out > 0) {
    throw MapFileError(file, "has " + std::to_string(left_out) + " voxels farther than " +
                                 fixed(map.reach_m(), 0) +
                                 " m from its origin, where an octree of --resolution " +
                                 fixed(config.resolution_m, 3) + " ends; choose a coarser one");
  }
  return map;
}

/// Where octree and answers come from.
class OccupancySource {
 public:
  explicit OccupancySource(const OctomapArguments& arguments) {
    if (arguments.map.empty()) {
      client_.emplace(connect(arguments.client));
    } else {
      map_.emplace(open_map(arguments));
    }
  }
  [[nodiscard]] OctomapData octomap(OctomapEncoding encoding) {
    return map_ ? map_->encode(encoding) : client_->octomap(encoding);
  }
  [[nodiscard]] OccupancyAnswers answer(const OccupancyQuery& query) {
    return map_ ? map_->answer(query) : client_->query_occupancy(query);
  }
  /// What of the scans that a server has mapped may not be in its octree; empty where all is.
  [[nodiscard]] std::string missing() {
    if (map_) return {};
    const dds::ServerStatus status = client_->status();
    const std::uint64_t dropped = status.counter("occupancy_scans_dropped");
    if (dropped == 0) return {};
    // Counted over all maps: a reset, a load and a correction of the path make the octree anew.
    return "the octree of the server could not keep up: since it started, " +
           std::to_string(dropped) + " of the " + std::to_string(status.counter("scans_mapped")) +
           " scans that were mapped did not come into it (it is made anew by a reset, a load and "
           "a closed loop: what was left out before that is nothing it lacks); an octree of the "
           "whole static map: 'stillmap octomap --map MAPFILE'";
  }

 private:
  std::optional<OccupancyMap> map_;
  std::optional<Client> client_;
};

ExitCode run(const OctomapArguments& arguments) {
  end_cleanly_when_stopped();
  const OccupancyQuery query = query_of(arguments);
  const bool asks =
      !arguments.points.empty() || !arguments.boxes.empty() || !arguments.rays.empty();
  const OctomapEncoding encoding =
      arguments.output.empty() ? OctomapEncoding::binary : octomap_encoding_of(arguments.output);
  OccupancySource source(arguments);
  Json report;
  std::string text;
  OccupancyAnswers answers;
  if (asks) {
    answers = source.answer(query);
    report.set("answers", to_json(answers));
    text += describe(query, answers);
  }
  if (!asks || !arguments.output.empty()) {
    const OctomapData data = source.octomap(encoding);
    const OctomapSummary summary = summarize(data);
    report.set("octomap", to_json(summary));
    text += describe(summary);
    if (!arguments.output.empty()) {
      write_octomap_file(arguments.output, data);
      text += "written to " + arguments.output + "\n";
    }
  }
  std::cout << (arguments.json ? report.dump(2) + "\n" : text);
  if (const std::string missing = source.missing(); !missing.empty())
    std::cerr << "stillmap: " << missing << "\n";
  return refused(answers) == 0 ? ExitCode::ok : ExitCode::bad_input;
}

}  // namespace

void add_octomap_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<OctomapArguments>();
  CommandHandle command = program.command(
      "octomap", "Occupied, free and unknown space: queries, and files for octovis");
  command.option("--output,--out,-o", arguments->output,
                 "Write the octree to FILE.bt (occupied and free) or FILE.ot (probabilities)");
  const OptionHandle map =
      command.option("--map,MAPFILE", arguments->map,
                     "Take a stored map (.stillmap: its static voxels are occupied, all else is "
                     "unknown) or an OctoMap file (.bt, .ot) instead of a server");
  command
      .option("--resolution", arguments->resolution_m,
              "Voxel size for a .stillmap map [m]; default: " +
                  fixed(OccupancyConfig{}.resolution_m, 1))
      .above_zero()
      .needs(map);
  command.option("--point", arguments->points, "x,y,z: occupied, free or unknown?")
      .comma_separated();
  const OptionHandle box =
      command
          .option("--box", arguments->boxes,
                  "x_min,y_min,z_min,x_max,y_max,z_max: how many voxels are what")
          .comma_separated();
  const OptionHandle ray =
      command
          .option("--ray", arguments->rays,
                  "x,y,z,dx,dy,dz: what a ray from there in that direction meets first")
          .comma_separated();
  command.option("--max-range", arguments->max_range_m, "Length of rays [m], at most 1000")
      .with_default()
      .needs(ray);
  command
      .flag("--through-unknown", arguments->through_unknown,
            "Rays continue through unknown space instead of ending there")
      .needs(ray);
  command
      .option("--max-voxels", arguments->max_voxels,
              "Occupied voxels that --json lists for all boxes together")
      .with_default()
      .needs(box);
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap octomap --output city.bt                     then: octovis city.bt\n"
      "  stillmap octomap --map city_map/map.stillmap --output city.ot\n"
      "  stillmap octomap --point 5,0,0 --ray 0,0,0,1,0,0 --max-range 30\n"
      "  stillmap octomap --map city.bt --box -2,-2,0,2,2,2 --json\n"
      "Coordinates are in the map frame [m]. --point, --box and --ray may be given several times;\n"
      "without any, what the octree holds is printed. Free is only what a ray passed. Exit code 2\n"
      "when any of them cannot be asked, as a point outside the octree; the others are answered.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
