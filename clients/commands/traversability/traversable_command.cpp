#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "clients/commands/traversability/traversability_geojson.hpp"
#include "clients/commands/traversability/traversability_report.hpp"
#include "clients/commands/traversability/traversability_source.hpp"
#include "core/picture/traversability_picture.hpp"
#include "core/traversability/nav2_map.hpp"
#include "core/traversability/traversability_query.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  TraversabilitySourceArguments source;
  RegionArguments region;
  std::string out;
  std::string picture;
  std::string outlines;
  double min_outline_area_m2 = 1.0;
  bool json = false;
};

TraversabilityAnswer query_traversability(TraversabilitySource& source,
                                          const Arguments& arguments) {
  TraversabilityQuery query;
  query.region = region_of(arguments.region, source);
  query.include_outlines = !arguments.outlines.empty();
  query.min_outline_area_m2 = arguments.min_outline_area_m2;
  TraversabilityAnswer answer = source.traversability(query);
  if (answer.grid.status != TraversabilityStatus::ok)
    throw std::invalid_argument(answer.grid.reason);
  return answer;
}

void draw(const std::string& file, const TraversabilityView& view, TraversabilitySource& source) {
  TraversabilityPictureOptions options;
  options.trajectory = source.trajectory();
  write_traversability_picture(file, view, options);
}

ExitCode run(const Arguments& arguments) {
  check_region(arguments.region);
  const auto began = std::chrono::steady_clock::now();
  const std::unique_ptr<TraversabilitySource> source = open_traversability_source(arguments.source);
  const TraversabilityAnswer answer = query_traversability(*source, arguments);
  const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - began;
  const TraversabilityView view = view_of_answer(answer, source->robot());
  const TraversabilityReport report{
      .summary = summarize(answer), .work = source->update_stats(), .milliseconds = took.count()};
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
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = program.command(
      "traversable", "Where a robot can drive, of a server or on a stored map, and why not");
  add_traversability_source_options(command, arguments->source);
  add_region_options_2d(command, arguments->region);
  command.option("--out", arguments->out,
                 "Folder for Nav2's map_server: map.yaml and map.pgm; made if need be");
  command.option("--picture", arguments->picture, "Draw the area and its reasons to FILE.png");
  command.option("--outlines", arguments->outlines,
                 "Write the outlines of free areas, with holes, to FILE.json (as GeoJSON, in [m])");
  command
      .option("--min-outline-area", arguments->min_outline_area_m2,
              "Leave out smaller pieces of the outlines [m2]")
      .with_default();
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
