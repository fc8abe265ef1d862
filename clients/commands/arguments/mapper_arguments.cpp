#include "clients/commands/arguments/mapper_arguments.hpp"

#include <algorithm>
#include <stdexcept>

#include "clients/commands/dataset/recording.hpp"
#include "config/loaders/model_file.hpp"
#include "config/loaders/sensor_file.hpp"
#include "config/loaders/server_config.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/lidar/sensor_fit.hpp"

namespace stillmap::cli {

void add_engine_options(CommandHandle command, EngineArguments& arguments) {
  command
      .option("--engine", arguments.engine,
              "What runs the network: auto (oneDNN where it can, else OpenCV), onednn, opencv")
      .one_of({"auto", "onednn", "opencv"});
  command
      .option("--precision", arguments.precision,
              "Numbers of the network: auto (int8 where the model is calibrated), fp32, int8")
      .one_of({"auto", "fp32", "int8"});
  command
      .option("--threads", arguments.threads,
              "Threads of oneDNN for one scan, one scan at a time; default: all cores, as is best")
      .between(0, 1024);
}

void set_engine(const EngineArguments& arguments, EngineOptions& choice) {
  using Engine = EngineOptions::Engine;
  using PrecisionMode = EngineOptions::PrecisionMode;
  if (arguments.engine == "auto") choice.engine = Engine::automatic;
  if (arguments.engine == "onednn") choice.engine = Engine::onednn;
  if (arguments.engine == "opencv") choice.engine = Engine::opencv;
  if (arguments.precision == "auto") choice.precision = PrecisionMode::automatic;
  if (arguments.precision == "fp32") choice.precision = PrecisionMode::fp32;
  if (arguments.precision == "int8") choice.precision = PrecisionMode::int8;
  if (arguments.threads > 0) choice.threads = static_cast<int>(arguments.threads);
}

void add_segmentation_options(CommandHandle command, MapperArguments& arguments) {
  command
      .option(
          "--columns", arguments.columns,
          "Columns of the range image of a model that runs; default: as configured, else as the "
          "model says")
      .between(min_image_columns, max_image_columns);
  add_engine_options(command, arguments.engine);
  command
      .option("--stance", arguments.stance,
              "How the lidar leans, and its height, for a model that runs: auto (as the mount "
              "says; where that tells neither, as the ground shows), mount (as the mount says, "
              "else upright); default: as configured, else auto")
      .one_of({"auto", "mount"});
  command
      .option("--mirrored", arguments.mirrored,
              "on: a model that runs sees each scan a second time, in a mirror, and the mean of "
              "both counts: it finds a little more, in twice the time; off: once; default: on with "
              "--drive-votes on, else as configured, else off")
      .one_of({"on", "off"});
}

void add_mapper_options(CommandHandle command, MapperArguments& arguments) {
  command.option("--config", arguments.config_file,
                 "Server file (config/server/*.yaml); its mapper settings are used");
  command.option(
      "--sensor", arguments.sensor,
      "hdl_64e, hdl_32e, vlp_16, a sensor file, or auto (the scans tell); default: that of "
      "--config, else auto");
  command
      .option(
          "--labels", arguments.labels,
          "Where classes come from: auto (each scan's own, if it has any, else the model's), "
          "files (must have them), model (the default one that comes with Stillmap), none (pure "
          "geometry), the name of one that comes with Stillmap (street, kitti), or a folder "
          "with a model")
      .with_default();
  std::vector<std::string> weighting_names;
  weighting_names.reserve(named_weightings.size());
  for (const NamedWeighting& known : named_weightings) weighting_names.emplace_back(known.name);
  command
      .option("--weighting", arguments.weighting,
              "What a correspondence counts, the rows of the paper's Table I: none, "
              "geometric, semantic; default: as configured")
      .one_of(weighting_names);
  add_segmentation_options(command, arguments);
}

const char* name(Weighting weighting) {
  return std::ranges::find(named_weightings, weighting, &NamedWeighting::weighting)->name;
}

Weighting weighting_from_name(const std::string& weighting_name) {
  for (const auto& [known_name, weighting] : named_weightings) {
    if (weighting_name == known_name) return weighting;
  }
  throw std::invalid_argument("weighting '" + weighting_name +
                              "' is not known; there are none, geometric and semantic");
}

bool MapperArguments::names_sensor() const { return !sensor.empty() && sensor != "auto"; }

std::string sensor_origin(const MapperArguments& arguments) {
  if (arguments.names_sensor()) return "option";
  if (!arguments.sensor.empty() || arguments.config_file.empty()) return "scans";
  return load_server_config(arguments.config_file).automatic_sensor.is_on ? "scans"
                                                                          : "configuration";
}

namespace {

/// The sensor is not that of the file, whose ranges may leave no point of it.
void use_other_sensor(const SensorModel& sensor, const std::string& config_file,
                      ServerConfig& server) {
  if (const auto fault = range_fault(sensor, server.automatic_sensor, server.mapper.prepare)) {
    throw std::invalid_argument(config_file + ": prepare." + fault->field + ": " + fault->text);
  }
  use_sensor(sensor, server.automatic_sensor, server.mapper);
}

}  // namespace

MapperConfig mapper_config(const MapperArguments& arguments, const SensorModel& suggested_sensor) {
  ServerConfig server;
  if (!arguments.config_file.empty()) server = load_server_config(arguments.config_file);
  if (arguments.names_sensor()) {
    use_other_sensor(load_sensor(arguments.sensor), arguments.config_file, server);
  } else if (server.automatic_sensor.is_on || !arguments.sensor.empty()) {
    use_other_sensor(suggested_sensor, arguments.config_file, server);
  }
  MapperConfig& config = server.mapper;
  if (!arguments.weighting.empty()) {
    config.odometry.weighting = weighting_from_name(arguments.weighting);
  }
  return config;
}

namespace {

LabelsConfig labels_config(const MapperArguments& arguments, const ScanDataset& dataset) {
  LabelsConfig labels;
  if (!arguments.config_file.empty()) labels = load_server_config(arguments.config_file).labels;
  if (arguments.labels == "none") {
    labels.source = LabelProvider::none;
  } else if (arguments.labels == "files") {
    if (!dataset.has_labels()) {
      throw std::invalid_argument(dataset.file(0).string() +
                                  " has no labels: use --labels model or none");
    }
    labels.source = LabelProvider::stream;
  } else if (arguments.labels == "model") {
    labels.source = LabelProvider::model;
  } else if (arguments.labels != "auto") {
    labels.source = LabelProvider::model;
    labels.model = arguments.labels;
  } else if (labels.source == LabelProvider::automatic && !dataset.has_labels()) {
    labels.source = LabelProvider::model;
  } else if (labels.source == LabelProvider::automatic && !dataset.lacks_labels()) {
    labels.source = LabelProvider::stream;
  }
  if (labels.source == LabelProvider::stream || labels.source == LabelProvider::automatic)
    require_semantic_kitti_labels(dataset);
  if (arguments.columns > 0) labels.image_columns = static_cast<int>(arguments.columns);
  set_engine(arguments.engine, labels.engine);
  if (!arguments.stance.empty()) labels.finds_stance = arguments.stance == "auto";
  if (!arguments.mirrored.empty()) labels.mirrored = arguments.mirrored == "on";
  return labels;
}

}  // namespace

std::unique_ptr<Segmenter> make_segmenter(const MapperArguments& arguments,
                                          const ScanDataset& dataset,
                                          const Eigen::Isometry3d& T_base_lidar) {
  return open_segmenter(labels_config(arguments, dataset),
                        mapper_config(arguments, dataset.suggested_sensor()).sensor, false,
                        T_base_lidar);
}

std::string describe_model(const MapperArguments& arguments, const ScanDataset& dataset,
                           const Segmenter& segmenter) {
  const LabelsConfig labels = labels_config(arguments, dataset);
  if (labels.source == LabelProvider::stream && dataset.has_labels() && dataset.lacks_labels())
    return "stillmap: some scans have no labels, and no point of them gets a class: --labels auto "
           "has the model label them\n";
  if (segmenter.details().empty()) return {};
  std::string text = "stillmap: labels by " + segmenter.name() + ": " + segmenter.details() + "\n";
  const std::string better =
      better_model(labels, mapper_config(arguments, dataset.suggested_sensor()).sensor);
  if (!better.empty()) text += "stillmap: " + better + "; --labels chooses\n";
  return text;
}

std::string describe_sensor_mismatch(const ScanDataset& dataset, const SensorModel& sensor) {
  const std::size_t samples = std::min<std::size_t>(dataset.size(), 5);
  std::size_t read = 0, misfits = 0;
  std::string misfit;
  for (std::size_t k = 0; k < samples; ++k) {
    try {
      const Scan scan = dataset.read((2 * k + 1) * dataset.size() / (2 * samples)).scan;
      ++read;
      const std::string words = sensor_mismatch(scan, sensor);
      if (words.empty()) continue;
      ++misfits;
      misfit = words;
    } catch (const DatasetError&) {
      // Whoever needs that scan is told.
      continue;
    }
  }
  if (2 * misfits <= read) return {};
  return "stillmap: " + misfit +
         ": --sensor names another ('stillmap dataset sensor' makes a sensor file from a "
         "recording)\n";
}

}  // namespace stillmap::cli
