#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/mapping/map_output.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_scan_source.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string dataset;
  std::string topic_in;
  std::string out = "stillmap_out";
  MapperArguments mapper;
  ScanRange range;
  bool force = false;
  bool json = false;
};

MappingResult map_with_progress(const ScanDataset& dataset, const Arguments& arguments,
                                const MapperConfig& config, StopSignal& stop) {
  const std::size_t total = arguments.range.end(dataset) - arguments.range.first;
  Progress progress("map", "scans", total);
  std::size_t skipped = 0;
  const auto scan_done = [&](std::size_t seen) {
    progress.update(seen, skipped == 0 ? "" : std::to_string(skipped) + " left out");
    return !stop.requested();
  };
  const auto scan_skipped = [&](const SkippedScan& scan) {
    ++skipped;
    progress.say("stillmap: left out: " + scan.reason);
  };
  return map_dataset(dataset, arguments.range, config, label_source(arguments.mapper, dataset),
                     scan_done, scan_skipped);
}

void write_report(const std::filesystem::path& file, const nlohmann::json& report) {
  std::ofstream out(file, std::ios::trunc);
  out << report.dump(2) << "\n";
  out.close();
  if (!out) throw DatasetError(file, "cannot be written; check the folder and the space left");
}

ExitCode run(const Arguments& arguments) {
  StopSignal stop;
  const ScanDataset dataset = dds::open_sequence(arguments.dataset, arguments.topic_in);
  const MapperConfig config = mapper_config(arguments.mapper, dataset.suggested_sensor());
  prepare_output_folder(arguments.out, arguments.force);
  const MappingResult result = map_with_progress(dataset, arguments, config, stop);
  if (result.trajectory.empty()) {
    std::cerr << "stillmap: no scan of " << arguments.dataset << " could be mapped\n";
    return ExitCode::bad_input;
  }
  const MapOutput output = write_map_output(arguments.out, dataset, result, config);
  const nlohmann::json report = to_json(result, output);
  write_report(output.folder / "report.json", report);
  std::cout << (arguments.json ? report.dump(2) + "\n" : describe(result, output));
  if (result.stopped)
    std::cerr << "stillmap: stopped early, as asked; the files hold what was mapped\n";
  return result.stopped ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_map_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command =
      program.command("map", "Map a recording in this process: the server's mapper without DDS");
  command.option("DATASET", arguments->dataset, dataset_kinds).required();
  command.option("--topic-in", arguments->topic_in, topic_in_help);
  command.option("--out", arguments->out, "Folder for the results").with_default();
  add_mapper_options(command, arguments->mapper);
  command.option("--start", arguments->range.first, "Number of the first scan");
  command.option("--scans,--count", arguments->range.count, "Take as many scans at most");
  command.flag("--strict", arguments->range.strict,
               "Stop at the first damaged file instead of leaving it out");
  command.flag("--force", arguments->force, "Replace a map that is there already");
  command.flag("--json", arguments->json, "Print report.json instead of the summary");
  command.explain(
      "Examples:\n"
      "  stillmap map sequences/00 --out kitti00 --scans 500\n"
      "  stillmap map my_vlp16_pcds --sensor vlp_16 --labels none --out campus\n"
      "  stillmap map city --weighting none --out plain --json | jq .accuracy\n"
      "Writes map.stillmap (SQLite), map.ply, map.pcd, map.png, poses_lidar.txt (KITTI 3x4, lidar\n"
      "frame), poses_tum.txt (the same with stamps), report.json (timing, memory, accuracy), and\n"
      "with true poses in the recording trajectory.png and trajectory_error.png. A damaged file\n"
      "is named and left out; its scan then has no line in poses_lidar.txt.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
