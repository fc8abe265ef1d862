#include <cmath>
#include <iostream>
#include <memory>

#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/dataset/label_scatter.hpp"
#include "core/dataset/scan_merge.hpp"

namespace stillmap::cli {
namespace {

struct AggregateArguments {
  std::string sequence;
  std::string out;
  MergeOptions merge;
  bool json = false;
};

Json to_json(const MergedClouds& merged) {
  Json files = Json::array();
  for (const std::filesystem::path& file : merged.files) files.push_back(file.string());
  const Eigen::Vector3d& origin = merged.origin_map;
  return {{"files", files},
          {"scans", merged.scans},
          {"points", merged.points},
          {"skipped", merged.left_out},
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
            " points without finite coordinates skipped; their labels stay as they are\n";
  }
  for (const std::filesystem::path& file : merged.files) text += file.string() + "\n";
  return text;
}

ExitCode run(const AggregateArguments& arguments) {
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

struct ScatterArguments {
  std::string cloud;
  std::string sequence;
  bool json = false;
};

Json to_json(const ScatterResult& result) {
  return {
      {"points_in_cloud", result.points_in_cloud}, {"scans_in_cloud", result.scans_in_cloud},
      {"points_missing", result.points_missing},   {"labels_changed", result.labels_changed},
      {"scans_changed", result.scans_changed},     {"instances_dropped", result.instances_dropped}};
}

std::string describe(const ScatterResult& result) {
  std::string text = std::to_string(result.points_in_cloud) + " points of " +
                     std::to_string(result.scans_in_cloud) +
                     " scans: " + std::to_string(result.labels_changed) + " labels changed in " +
                     std::to_string(result.scans_changed) + " scans\n";
  if (result.points_missing > 0) {
    text += std::to_string(result.points_missing) +
            " points of these scans are not in the cloud and keep their labels\n";
  }
  if (result.instances_dropped > 0) {
    text += std::to_string(result.instances_dropped) +
            " of the changed points had an instance and have none now\n";
  }
  if (result.scans_changed > 0) text += "the labels before the first change are in labels.bak/\n";
  return text;
}

ExitCode run(const ScatterArguments& arguments) {
  std::unique_ptr<Progress> progress;
  const ScatterResult result = scatter_labels(
      arguments.cloud, arguments.sequence, [&](std::uint64_t done, std::uint64_t total) {
        if (!progress) progress = std::make_unique<Progress>("scatter", "points", total);
        progress->update(done);
      });
  progress.reset();
  std::cout << (arguments.json ? to_json(result).dump(2) + "\n" : describe(result));
  return ExitCode::ok;
}

}  // namespace

void add_dataset_aggregate_command(CommandHandle dataset, Action& action) {
  auto arguments = std::make_shared<AggregateArguments>();
  MergeOptions& merge = arguments->merge;
  CommandHandle command =
      dataset.command("aggregate", "Merge the scans of a sequence into one cloud to be labelled");
  command.option("SEQUENCE", arguments->sequence, "A SemanticKITTI sequence with poses").required();
  command.option("OUT", arguments->out, "The cloud, FILE.ply").ends_in(".ply").required();
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
      "The PLY has x y z intensity, red green blue (of the class), label (SemanticKITTI id), "
      "instance, scan_index and point_index. Edit 'label' (and 'instance'); points may be deleted, "
      "reordered and saved as ascii or binary with fields of any type, as long as scan_index and "
      "point_index stay. All points of the scans are in it: nothing is downsampled.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_dataset_scatter_command(CommandHandle dataset, Action& action) {
  auto arguments = std::make_shared<ScatterArguments>();
  CommandHandle command =
      dataset.command("scatter", "Write the labels of an edited cloud back to its scans");
  command.option("CLOUD", arguments->cloud, "A .ply of 'dataset aggregate', edited").required();
  command.option("SEQUENCE", arguments->sequence, "The sequence that it was merged from")
      .required();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap dataset scatter campus.ply campus\n"
      "  for tile in campus_x*_y*.ply; do stillmap dataset scatter $tile campus; done\n"
      "Points are known by scan_index and point_index (also scalar_scan_index, as CloudCompare "
      "writes); those that are gone from the cloud keep their labels. A damaged or foreign cloud "
      "changes nothing. Old labels are kept once, in labels.bak/. Where the editor dropped the "
      "field 'instance', points whose class stayed keep their instance.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
