#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/command.hpp"
#include "clients/terminal/progress.hpp"
#include "core/dataset/label_scatter.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string cloud;
  std::string sequence;
  bool json = false;
};

nlohmann::json to_json(const ScatterResult& result) {
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

ExitCode run(const Arguments& arguments) {
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

void add_dataset_scatter_command(CommandHandle dataset, Action& action) {
  auto arguments = std::make_shared<Arguments>();
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
      "Points are known by scan_index and point_index (also scalar_scan_index, as CloudCompare\n"
      "writes); those that are gone from the cloud keep their labels. A damaged or foreign cloud\n"
      "changes nothing. Old labels are kept once, in labels.bak/. Where the editor dropped the\n"
      "field 'instance', points whose class stayed keep their instance.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
