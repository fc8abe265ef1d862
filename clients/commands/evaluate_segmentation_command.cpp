#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/text.hpp"
#include "core/dataset/binary_file.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/evaluation/confusion_matrix.hpp"

namespace stillmap {
namespace {

struct Arguments {
  std::string truth, predictions;
  bool json = false;
};

// The .label files of the folder itself, or of the subfolder that the data set's layout has.
std::vector<std::filesystem::path> label_files(const std::filesystem::path& folder,
                                               const char* subfolder) {
  const std::filesystem::path inner = folder / subfolder;
  const std::filesystem::path& place = std::filesystem::is_directory(inner) ? inner : folder;
  if (!std::filesystem::is_directory(place)) throw DatasetError(place, "is not a folder");
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(place)) {
    if (entry.path().extension() == ".label") files.push_back(entry.path());
  }
  if (files.empty()) throw DatasetError(place, "holds no .label files");
  std::sort(files.begin(), files.end());
  return files;
}

ConfusionMatrix compare(const Arguments& arguments) {
  const auto predictions = label_files(arguments.predictions, "predictions");
  const std::filesystem::path truth_folder =
      label_files(arguments.truth, "labels").front().parent_path();
  Progress progress("compare", "scans", predictions.size());
  ConfusionMatrix matrix;
  std::uint64_t done = 0;
  for (const std::filesystem::path& prediction : predictions) {
    const auto predicted = read_values<std::uint32_t>(prediction);
    const std::filesystem::path truth = truth_folder / prediction.filename();
    if (!std::filesystem::exists(truth)) {
      throw DatasetError(truth, "is missing: there is a prediction for it");
    }
    matrix.add(reduced_classes(read_kitti_labels(truth, predicted.size())),
               reduced_classes(predicted));
    progress.update(++done);
  }
  return matrix;
}

nlohmann::json to_json(const ConfusionMatrix& matrix) {
  nlohmann::json by_class = nlohmann::json::object();
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    const auto label = static_cast<SemanticClass>(k);
    const std::optional<double> iou = matrix.iou(label);
    by_class[std::string(name(label))] = iou ? nlohmann::json(*iou) : nlohmann::json(nullptr);
  }
  return {{"points", matrix.total()},
          {"miou", matrix.mean_iou()},
          {"miou_present", matrix.mean_iou_of_present().value_or(0.0)},
          {"accuracy", matrix.accuracy().value_or(0.0)},
          {"iou", by_class}};
}

void print(const ConfusionMatrix& matrix) {
  Table table({"class", "IoU %"});
  for (std::size_t k = 1; k < semantic_class_count; ++k) {
    const auto label = static_cast<SemanticClass>(k);
    const std::optional<double> iou = matrix.iou(label);
    table.add({std::string(name(label)), iou ? fixed(100.0 * *iou, 2) : "-"});
  }
  table.add({"mean of 19", fixed(100.0 * matrix.mean_iou(), 2)});
  table.add({"mean of those seen", fixed(100.0 * matrix.mean_iou_of_present().value_or(0.0), 2)});
  table.add({"accuracy", fixed(100.0 * matrix.accuracy().value_or(0.0), 2)});
  std::cout << table.text() << matrix.total()
            << " labelled points; unlabeled truth is left out, as in semantic-kitti-api\n";
}

ExitCode run(const Arguments& arguments) {
  const ConfusionMatrix matrix = compare(arguments);
  if (arguments.json) {
    std::cout << to_json(matrix).dump(2) << "\n";
  } else {
    print(matrix);
  }
  return ExitCode::ok;
}

}  // namespace

void add_evaluate_segmentation_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = evaluate.command("segmentation", "IoU of every class and their mean");
  command.option("--truth", arguments->truth, "Folder with true .label files, or a sequence")
      .required();
  command
      .option("--predictions", arguments->predictions,
              "Folder with predicted .label files (original ids)")
      .required();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Example:\n"
      "  stillmap evaluate segmentation --truth sequences/08 --predictions my_net/08\n"
      "Files pair by name. Every prediction needs its truth; scans without a prediction do not "
      "count.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap
