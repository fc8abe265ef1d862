#include <filesystem>
#include <iostream>
#include <map>
#include <memory>

#include "clients/commands/command.hpp"
#include "clients/commands/model/model_arguments.hpp"
#include "clients/terminal/progress.hpp"
#include "config/loaders/int8_file.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn/prepare_network.hpp"
#include "core/segmentation/onednn_network.hpp"

namespace stillmap::cli {
namespace {

struct ModelCalibrateArguments {
  ModelArguments model;
  std::vector<std::string> datasets;
  std::uint64_t scans = 32;
  double share = 0.9995;
  std::vector<std::string> float_layers;
};

/// A model and its network for the sensor of one data set.
struct FittedNetwork {
  ModelDescription model;
  OneDnnNetwork network;

  FittedNetwork(const ModelArguments& arguments, const ModelDescription& any,
                const SensorModel& sensor)
      : model(fitted(arguments, any, sensor)), network(model, Precision::fp32) {}
};

ActivationRanges observe_activations(const ModelArguments& arguments, const ModelDescription& model,
                                     const std::vector<ScanSample>& samples) {
  std::map<const ScanDataset*, FittedNetwork> networks;
  ActivationRanges ranges;
  Progress progress("calibrate", "scans", samples.size());
  std::uint64_t done = 0;
  for (const ScanSample& sample : samples) {
    FittedNetwork& fitted =
        networks.try_emplace(sample.dataset, arguments, model, sample.dataset->suggested_sensor())
            .first->second;
    fitted.network.observe(input_of(sample, fitted.model),
                           [&ranges](const std::string& tensor, auto values, std::size_t channels) {
                             ranges.add(tensor, values, channels);
                           });
    progress.update(++done);
  }
  return ranges;
}

/// Else every start would refuse the file.
void require_usable(const Int8Calibration& calibration, const ModelDescription& model) {
  const PreparedNetwork network = prepare_network(OnnxFile(model.network_file), model);
  std::string fault = float_layer_fault(network.file_layers, calibration);
  if (fault.empty()) fault = calibration_fault(network.graph, calibration);
  if (fault.empty()) return;
  throw ModelError(
      model.network_file.parent_path() / "int8.yaml",
      "is not written: " + fault +
          "; calibrate with more --scans, other data sets or --float-layers, or use the model with "
          "precision: fp32");
}

ExitCode run(const ModelCalibrateArguments& arguments) {
  const ModelDescription model = load_uncalibrated_model(arguments.model);
  if (std::filesystem::path(arguments.model.model).extension() == ".onnx") {
    throw ModelError(model.network_file,
                     "is a network alone, and how its input is normalised is not known; name its "
                     "folder, with a model.yaml");
  }
  std::vector<ScanDataset> datasets;
  for (const std::string& folder : arguments.datasets) datasets.emplace_back(folder);
  const std::vector<ScanSample> samples = choose_scans(datasets, arguments.scans);
  const ActivationRanges ranges = observe_activations(arguments.model, model, samples);
  Int8Calibration calibration;
  calibration.made = std::to_string(samples.size()) + " scans of " +
                     std::to_string(datasets.size()) + " data sets";
  calibration.range_of_channels = ranges.ranges(arguments.share);
  calibration.float_layers = arguments.float_layers;
  calibration.network_crc32 = crc32_of(model.network_file);
  require_usable(calibration, fitted(arguments.model, model, datasets.front().suggested_sensor()));
  const std::filesystem::path file = model.network_file.parent_path() / "int8.yaml";
  save_int8_calibration(calibration, file);
  std::cout << file.string() << ": " << calibration.range_of_channels.size() << " tensors, "
            << calibration.made << "\n";
  return ExitCode::ok;
}

}  // namespace

void add_model_calibrate_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<ModelCalibrateArguments>();
  CommandHandle command =
      model.command("calibrate", "Make int8.yaml, with which a model runs in 8-bit integers");
  add_model_options(command, arguments->model);
  command
      .option("DATASET", arguments->datasets,
              "Data sets like those on which the network will work; no labels are needed")
      .required();
  command.option("--scans", arguments->scans, "Scans to look at, evenly chosen")
      .above_zero()
      .with_default();
  command
      .option("--share", arguments->share,
              "Share of a channel's values that must not be cut off, 0..1; 1: none is")
      .above_zero()
      .with_default();
  command
      .option("--float-layers", arguments->float_layers,
              "Layers to keep in floating point, besides the first and the last")
      .comma_separated();
  command.explain(
      "Example:\n"
      "  stillmap model calibrate my_model sequences/00 sequences/01 --scans 32\n"
      "'stillmap model agree' then shows what int8 changes.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
