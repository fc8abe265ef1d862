#include <cmath>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/command.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/dataset/scan_merge.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string sequence;
  std::string out;
  MergeOptions merge;
  bool json = false;
};

nlohmann::json to_json(const MergedClouds& merged) {
  nlohmann::json files = nlohmann::json::array();
  for (const std::filesystem::path& file : merged.files) files.push_back(file.string());
  const Eigen::Vector3d& origin = merged.origin_map;
  return {{"files", files},
          {"scans", merged.scans},
          {"points", merged.points},
          {"left_out", merged.left_out},
          {"origin_map_m", {origin.x(), origin.y(), origin.z()}}};
}

std::string describe(const MergedClouds& merged) {
  const Eigen::Vector3d& origin = merged.origin_map;
  std::string text = std::to_string(merged.scans) + " scans, " + std::to_string(merged.points) +
                     " points in " + std::to_string(merged.files.size()) +
                     " file(s), relative to x " + std::to_string(std::lround(origin.x())) + " y " +
                     std::to_string(std::lround(origin.y())) + " z " +
                     std::to_string(std::lround(origin.z())) + " m of the sequence's first pose\n";
  if (merged.left_out > 0) {
    text += std::to_string(merged.left_out) +
            " points without finite coordinates left out; their labels will stay\n";
  }
  for (const std::filesystem::path& file : merged.files) text += file.string() + "\n";
  return text;
}

ExitCode run(const Arguments& arguments) {
  StopSignal stop;
  const ScanDataset sequence(arguments.sequence);
  std::unique_ptr<Progress> progress;
  const MergedClouds merged = merge_scans(
      sequence, arguments.out, arguments.merge, [&](std::size_t done, std::size_t total) {
        if (!progress) progress = std::make_unique<Progress>("aggregate", "scans", total);
        progress->update(done);
        return !stop.requested();
      });
  progress.reset();
  if (merged.files.empty()) {
    std::cerr << "stillmap: stopped; nothing was written\n";
    return ExitCode::failed;
  }
  std::cout << (arguments.json ? to_json(merged).dump(2) + "\n" : describe(merged));
  return ExitCode::ok;
}

}  // namespace

void add_dataset_aggregate_command(CommandHandle dataset, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  MergeOptions& merge = arguments->merge;
  CommandHandle command =
      dataset.command("aggregate", "Merge the scans of a sequence into one cloud to be labelled");
  command.option("SEQUENCE", arguments->sequence, "A SemanticKITTI sequence with poses").required();
  command.option("OUT", arguments->out, "The cloud, a .ply file").required();
  command.option("--from", merge.first, "Number of the first scan").with_default();
  command.option("--to", merge.last, "Number of the last scan");
  command.option("--every", merge.every, "Every n-th scan of these").above_zero().with_default();
  command
      .option("--tile", merge.tile_m,
              "A cloud for each square tile with edges of so many metres: OUT_x0_y-1.ply")
      .above_zero();
  command.flag("--force", merge.replace, "Replace clouds that are there already");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap dataset aggregate campus campus.ply\n"
      "  stillmap dataset aggregate sequences/00 block.ply --from 0 --to 500 --every 5 --tile 100\n"
      "The PLY has x y z intensity, red green blue (of the class), label (SemanticKITTI id),\n"
      "instance, scan_index and point_index. Edit 'label' (and 'instance'); points may be "
      "deleted,\n"
      "reordered and saved as ascii or binary with fields of any type, as long as scan_index and\n"
      "point_index stay. All points of the scans are in it: nothing is thinned.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
