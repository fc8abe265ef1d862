#include "clients/commands/model/model_arguments.hpp"

#include <algorithm>

#include "config/loaders/model_file.hpp"
#include "config/loaders/model_folder.hpp"
#include "core/lidar/range_image.hpp"
#include "core/segmentation/network_input.hpp"
#include "core/segmentation/open_network.hpp"

namespace stillmap::cli {
namespace {

constexpr int default_rows = 64;
constexpr int default_columns = 1024;

template <class Load>
ModelDescription load_by(const ModelArguments& arguments, Load load) {
  const auto rows = static_cast<int>(arguments.rows);
  const auto columns = static_cast<int>(arguments.columns);
  const std::filesystem::path model_path = arguments.model;
  if (model_path.extension() == ".onnx") {
    return describe_bare_network(model_path, rows > 0 ? rows : default_rows,
                                 columns > 0 ? columns : default_columns);
  }
  ModelDescription model = load(find_model(model_path));
  if (rows > 0) model.rows = rows;
  if (columns > 0) {
    model.columns = columns;
    model.min_columns = 0;
  }
  return model;
}

}  // namespace

void add_model_options(CommandHandle command, ModelArguments& arguments) {
  command
      .option("MODEL", arguments.model,
              "Name of a model that comes with Stillmap (street), or a folder with model.onnx and "
              "model.yaml")
      .required();
  command.option("--rows", arguments.rows, "Rows of the image; default: as model.yaml says")
      .between(1, 512);
  command
      .option("--columns", arguments.columns, "Columns of the image; default: as model.yaml says")
      .between(1, max_image_columns);
}

ModelDescription load_model(const ModelArguments& arguments) {
  return load_by(arguments, load_model_description);
}

ModelDescription load_uncalibrated_model(const ModelArguments& arguments) {
  return load_by(arguments, [](const std::filesystem::path& f) {
    return stillmap::load_uncalibrated_model(f);
  });
}

ModelDescription fitted(const ModelArguments& arguments, const ModelDescription& model,
                        const SensorModel& sensor) {
  ModelDescription fitted = for_sensor(model, sensor);
  if (arguments.rows > 0) fitted.rows = static_cast<int>(arguments.rows);
  if (arguments.columns > 0) fitted.columns = static_cast<int>(arguments.columns);
  return fitted;
}

std::vector<ScanSample> choose_scans(const std::vector<ScanDataset>& datasets, std::size_t count) {
  std::size_t total = 0;
  for (const ScanDataset& dataset : datasets) total += dataset.size();
  const std::size_t chosen = std::min(count, total);
  std::vector<ScanSample> samples;
  for (std::size_t i = 0; i < chosen; ++i) {
    std::size_t index = (2 * i + 1) * total / (2 * chosen);
    auto dataset = datasets.begin();
    for (; index >= dataset->size(); ++dataset) index -= dataset->size();
    samples.push_back({&*dataset, index});
  }
  return samples;
}

std::vector<float> input_of(const ScanSample& sample, const ModelDescription& model) {
  const Scan scan = sample.dataset->read(sample.index).scan;
  const RangeImage image(scan.points_lidar, model.projection());
  return make_network_input(scan, image, model);
}

}  // namespace stillmap::cli
