#include <algorithm>
#include <chrono>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "clients/commands/command.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "clients/commands/traversability/traversability_source.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/picture/traversability_picture.hpp"
#include "core/process/file_beside.hpp"
#include "core/traversability/nav2_map.hpp"
#include "core/traversability/traversability_map.hpp"
#include "core/traversability/traversability_query.hpp"

namespace stillmap::cli {
namespace {

/// Summary of the traversability of a region.
struct TraversabilityReport {
  TraversabilitySummary summary;
  /// Cost of the computation for a map file.
  std::optional<TraversabilityUpdate> update;
  /// From opening the source to the answer.
  double milliseconds = 0.0;
};

/// GeoJSON repeats the first corner at the end.
Json closed(const TraversableRing& ring) {
  Json corners = Json::array();
  for (const Eigen::Vector2d& corner : ring) corners.push_back({corner.x(), corner.y()});
  if (!ring.empty()) corners.push_back({ring.front().x(), ring.front().y()});
  return corners;
}

Json feature(const TraversablePolygon& polygon) {
  Json rings = Json::array({closed(polygon.outer)});
  for (const TraversableRing& hole : polygon.holes) rings.push_back(closed(hole));
  return {{"type", "Feature"},
          {"properties", {{"area_m2", area_m2(polygon)}}},
          {"geometry", {{"type", "Polygon"}, {"coordinates", std::move(rings)}}}};
}

/// Outlines in GeoJSON's form: a polygon with holes a feature, its area in its properties.
/// Coordinates are metres in the map frame, not degrees.
Json to_json(const TraversabilityAnswer& answer, const std::string& profile) {
  Json features = Json::array();
  for (const TraversablePolygon& polygon : answer.outlines) features.push_back(feature(polygon));
  return {{"type", "FeatureCollection"},
          {"frame", "map"},
          {"unit", "m"},
          {"profile", profile},
          {"map_version", answer.grid.map_version},
          {"features", std::move(features)}};
}

/// Throws std::runtime_error naming the file when it cannot be written.
void write_outlines(const std::string& file, const TraversabilityAnswer& answer,
                    const std::string& profile) {
  FileBeside beside(file);
  std::ofstream stream(beside.path(), std::ios::trunc);
  stream << to_json(answer, profile).dump(1) << "\n";
  stream.close();
  if (stream && !beside.put_in_place()) return;
  throw std::runtime_error(file + ": cannot be written; its folder must exist and be writable");
}

double square_metres(const TraversabilityView& view, std::uint64_t cells) {
  return static_cast<double>(cells) * view.cell_m * view.cell_m;
}

double ms_per_tile(const TraversabilityReport& report) {
  return report.milliseconds /
         static_cast<double>(std::max<std::size_t>(1, report.update->surfaces));
}

/// @pre `view` was made from the answer that the report is about
Json to_json(const TraversabilityView& view, const TraversabilityReport& report) {
  Json lethal = Json::object();
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    const auto reason = static_cast<BlockReason>(i);
    if (reason == BlockReason::none || reason == BlockReason::unknown) continue;
    lethal.set(std::string(name(reason)), square_metres(view, report.summary.lethal.at(i)));
  }
  Json json = {{"profile", view.profile.name},
               {"map_id", view.map_id},
               {"map_version", view.version},
               {"cell_m", view.cell_m},
               {"free_m2", square_metres(view, report.summary.free)},
               {"inferred_m2", square_metres(view, report.summary.inferred)},
               {"unknown_m2", square_metres(view, report.summary.unknown)},
               {"lethal_m2", lethal},
               {"ms", report.milliseconds}};
  if (report.update) {
    json.set("tiles", report.update->map_tiles);
    json.set("ms_per_tile", ms_per_tile(report));
  }
  return json;
}

std::string describe(const TraversabilityView& view, const TraversabilityReport& report) {
  const auto area = [&](std::uint64_t cells) { return fixed(square_metres(view, cells), 0); };
  Table table({"area for " + view.profile.name, "m2"});
  table.add({"free", area(report.summary.free)});
  table.add({"  of it inferred", area(report.summary.inferred)});
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    if (report.summary.lethal.at(i) == 0) continue;
    table.add({"lethal: " + std::string(name(static_cast<BlockReason>(i))),
               area(report.summary.lethal.at(i))});
  }
  table.add({"unknown", area(report.summary.unknown)});
  std::string update;
  if (report.update) {
    update.append(" (").append(std::to_string(report.update->map_tiles)).append(" tiles, ");
    update.append(fixed(ms_per_tile(report), 1)).append(" ms each)");
  }
  return table.text() + "map version " + std::to_string(view.version) + ", cells of " +
         fixed(view.cell_m, 2) + " m, in " + fixed(report.milliseconds, 0) + " ms" + update + "\n";
}

struct TraversableArguments {
  TraversabilitySourceArguments source;
  RegionArguments region;
  std::string out;
  std::string picture;
  std::string outlines;
  double min_outline_area_m2 = 1.0;
  bool json = false;
};

TraversabilityQuery query_of(const TraversableArguments& arguments, TraversabilitySource& source) {
  TraversabilityQuery query;
  query.region = region_of(arguments.region, source);
  query.include_outlines = !arguments.outlines.empty();
  query.min_outline_area_m2 = arguments.min_outline_area_m2;
  return query;
}

/// Throws std::invalid_argument for what cannot be asked, and std::runtime_error for what a
/// server's map has not yet.
TraversabilityAnswer query_traversability(TraversabilitySource& source,
                                          const TraversabilityQuery& query, bool may_grow) {
  TraversabilityAnswer answer = source.traversability(query);
  if (answer.grid.status == TraversabilityStatus::ok) return answer;
  if (answer.grid.status == TraversabilityStatus::not_found && may_grow)
    throw std::runtime_error(answer.grid.reason);
  throw std::invalid_argument(answer.grid.reason);
}

void draw(const std::string& file, const TraversabilityView& view, TraversabilitySource& source) {
  TraversabilityPictureOptions options;
  options.trajectory = source.trajectory();
  write_traversability_picture(file, view, options);
}

ExitCode run(const TraversableArguments& arguments) {
  end_cleanly_when_stopped();
  check_region(arguments.region);
  const auto began = std::chrono::steady_clock::now();
  const std::unique_ptr<TraversabilitySource> source = open_traversability_source(arguments.source);
  const TraversabilityQuery query = query_of(arguments, *source);
  const TraversabilityAnswer answer =
      query_traversability(*source, query, arguments.source.map_file.empty());
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
  const TraversabilityView view = view_of_answer(answer, source->robot());
  const TraversabilityReport report{.summary = summarize(answer, query.region),
                                    .update = source->update_stats(),
                                    .milliseconds = took.count()};
  if (!arguments.out.empty()) write_nav2_map(arguments.out, answer.grid);
  if (!arguments.outlines.empty()) {
    write_outlines(arguments.outlines, answer, view.profile.name);
  }
  if (!arguments.picture.empty()) draw(arguments.picture, view, *source);
  std::cout << (arguments.json ? to_json(view, report).dump(2) + "\n" : describe(view, report));
  return ExitCode::ok;
}

}  // namespace

void add_traversable_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<TraversableArguments>();
  CommandHandle command = program.command(
      "traversable", "Where a robot can drive, of a server or on a stored map, and why not");
  add_traversability_source_options(command, arguments->source);
  add_region_options_2d(command, arguments->region);
  command.option("--out,--output,-o", arguments->out,
                 "Folder for Nav2's map_server: map.yaml and map.pgm; made if need be");
  command.option("--picture", arguments->picture, "Draw the area and its reasons to FILE.png")
      .ends_in(".png");
  const OptionHandle outlines = command.option(
      "--outlines", arguments->outlines,
      "Write the outlines of free areas, with holes, to FILE.json (as GeoJSON, in [m])");
  command
      .option("--min-outline-area", arguments->min_outline_area_m2,
              "Leave out smaller pieces of the outlines [m2]")
      .with_default()
      .needs(outlines);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap traversable --around-robot 60 --picture car.png\n"
      "  stillmap traversable --corridor path.txt --width 10 --outlines way.json\n"
      "  stillmap traversable city_map/map.stillmap --profile delivery_robot --out nav2\n"
      "  stillmap traversable city_map/map.stillmap --profile my_robot.yaml --json\n"
      "Without MAPFILE, the server is asked, which keeps the areas of the robots that its\n"
      "configuration names. Regions are seen from above: heights do not count.\n"
      "A cell is free, lethal for a reason (obstacle, low head-room, step, slope, roughness,\n"
      "class, or inscribed: too near to such a cell), or unknown. 'Inferred' ground was not seen\n"
      "and follows from what lies around: between the lidar's rings, under removed cars.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
