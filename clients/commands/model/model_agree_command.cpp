#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <sstream>

#include "clients/commands/command.hpp"
#include "clients/commands/model/model_arguments.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/table.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/opencv_network.hpp"
#include "core/segmentation/pixel_scores.hpp"

namespace stillmap::cli {
namespace {

struct ModelAgreeArguments {
  ModelArguments model;
  std::string dataset;
  std::uint64_t scans = 20;
};

/// How one engine's probabilities compare with the reference's, over many images.
struct Agreement {
  std::string engine;
  std::size_t pixels = 0;
  std::size_t same = 0;
  float largest = 0.0F;
  double sum = 0.0;
  std::size_t values = 0;

  void add(std::span<const float> reference, std::span<const float> other, std::size_t outputs) {
    const PixelOutputs a = argmax_outputs(reference, outputs, ScoreKind::probabilities);
    const PixelOutputs b = argmax_outputs(other, outputs, ScoreKind::probabilities);
    for (std::size_t i = 0; i < a.output.size(); ++i) same += a.output[i] == b.output[i] ? 1 : 0;
    pixels += a.output.size();
    for (std::size_t i = 0; i < reference.size(); ++i) {
      const float difference = std::abs(reference[i] - other[i]);
      largest = std::max(largest, difference);
      sum += difference;
    }
    values += reference.size();
  }
};

std::string in_powers(double value) {
  std::ostringstream text;
  text.precision(1);
  text << std::scientific << value;
  return text.str();
}

void print(const std::vector<Agreement>& results, const std::string& reference) {
  Table table({"engine", "same class %", "largest difference", "mean difference"});
  for (const Agreement& result : results) {
    table.add(
        {result.engine,
         fixed(100.0 * static_cast<double>(result.same) / static_cast<double>(result.pixels), 3),
         in_powers(result.largest), in_powers(result.sum / static_cast<double>(result.values))});
  }
  std::cout << table.text() << "Against " << reference << ": class of " << results.front().pixels
            << " pixels, probabilities of all classes\n";
}

using Networks = std::vector<std::unique_ptr<SegmentationNetwork>>;

/// The reference, and what is compared with it.
Networks open_all(const ModelDescription& model) {
  Networks networks;
  networks.push_back(std::make_unique<OpenCvNetwork>(model));
  networks.push_back(std::make_unique<OneDnnNetwork>(model, Precision::fp32));
  if (model.int8) networks.push_back(std::make_unique<OneDnnNetwork>(model, Precision::int8));
  return networks;
}

ExitCode run(const ModelAgreeArguments& arguments) {
  std::vector<ScanDataset> datasets;
  datasets.emplace_back(arguments.dataset);
  const ModelDescription model =
      fitted(arguments.model, load_model(arguments.model), datasets.front().suggested_sensor());
  const Networks networks = open_all(model);
  std::vector<Agreement> results;
  for (std::size_t n = 1; n < networks.size(); ++n) {
    results.push_back({.engine = networks[n]->engine()});
  }
  const std::vector<ScanSample> samples = choose_scans(datasets, arguments.scans);
  Progress progress("agree", "scans", samples.size());
  std::uint64_t done = 0;
  for (const ScanSample& sample : samples) {
    const std::vector<float> input = input_of(sample, model);
    const std::vector<float> reference = networks.front()->probabilities(input);
    for (std::size_t n = 1; n < networks.size(); ++n) {
      results[n - 1].add(reference, networks[n]->probabilities(input), model.classes.size());
    }
    progress.update(++done);
  }
  print(results, networks.front()->engine());
  return ExitCode::ok;
}

}  // namespace

void add_model_agree_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<ModelAgreeArguments>();
  CommandHandle command = model.command("agree", "How far the engines agree on real scans");
  add_model_options(command, arguments->model);
  command.option("DATASET", arguments->dataset, "Data set whose scans are compared").required();
  command.option("--scans", arguments->scans, "Scans to compare, evenly chosen")
      .above_zero()
      .with_default();
  command.explain(
      "Example:\n"
      "  stillmap model agree my_model sequences/00 --scans 20\n"
      "The reference is OpenCV in fp32; int8 is shown where the model is calibrated.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
