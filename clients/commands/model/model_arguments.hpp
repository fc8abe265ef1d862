#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "clients/terminal/command_line.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/segmentation/model_description.hpp"

namespace stillmap::cli {

/// How a command line names a model and the size of its image.
struct ModelArguments {
  /// A model folder, or where that is allowed an ONNX file.
  std::string model;
  /// 0: as the model's description says.
  std::uint32_t rows = 0;
  std::uint32_t columns = 0;
};

/// Adds MODEL, --rows and --columns.
void add_model_options(CommandHandle command, ModelArguments& arguments);

/// The model in a folder, or a network file without a description. Throws ConfigError or
/// ModelError.
[[nodiscard]] ModelDescription load_model(const ModelArguments& arguments);
/// The same without reading int8.yaml.
[[nodiscard]] ModelDescription load_uncalibrated_model(const ModelArguments& arguments);

/// The model for a sensor, of the rows and columns that the arguments name.
[[nodiscard]] ModelDescription fitted(const ModelArguments& arguments,
                                      const ModelDescription& model, const SensorModel& sensor);

/// Scans of several data sets, evenly chosen.
struct ScanSample {
  const ScanDataset* dataset = nullptr;
  std::size_t index = 0;
};
[[nodiscard]] std::vector<ScanSample> choose_scans(const std::vector<ScanDataset>& datasets,
                                                   std::size_t count);

/// The network's input for the scan. @pre `model` is fitted to the sensor of the data set
[[nodiscard]] std::vector<float> input_of(const ScanSample& sample, const ModelDescription& model);

}  // namespace stillmap::cli
