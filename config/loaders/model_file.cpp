#include "config/loaders/model_file.hpp"

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "config/loaders/int8_file.hpp"
#include "config/loaders/model_folder.hpp"
#include "config/loaders/yaml_section.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/network_segmenter.hpp"
#include "core/segmentation/segmenter.hpp"
#include "idl/dds/shown_text.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

void read_image(YamlSection section, ModelDescription& model) {
  section.require({"rows", "columns", "fov_up_deg", "fov_down_deg"});
  section.integer("rows", model.rows, {1, 512});
  section.integer("columns", model.columns, {1, max_image_columns});
  section.integer("min_columns", model.min_columns, {0, static_cast<double>(model.columns)});
  section.degrees("fov_up_deg", model.fov_up, {-90, 90});
  section.degrees("fov_down_deg", model.fov_down, {-90, 90});
  section.boolean("follow_sensor", model.follow_sensor);
  section.boolean("mask_first_point", model.mask_first_point);
}

void read_channel(YamlSection section, InputStatistics& statistics, std::size_t channel) {
  section.require({"mean", "deviation"});
  section.number("mean", statistics.mean[channel], {-1e6, 1e6});
  section.number("deviation", statistics.deviation[channel], {1e-6, 1e6});
}

void read_statistics(YamlSection section, InputStatistics& statistics) {
  const auto plain_end = input_channel_names.begin() + plain_input_channels;
  std::vector<std::string> channels(input_channel_names.begin(), plain_end);
  section.require(channels);
  for (auto name = plain_end; name != input_channel_names.end(); ++name) {
    if (section.has(std::string(*name))) channels.emplace_back(*name);
  }
  statistics.channels = channels.size();
  for (std::size_t i = 0; i < channels.size(); ++i) {
    read_channel(section.section(channels[i]), statistics, i);
  }
}

/// Reads a field that holds the name of a class ("other-vehicle").
void read_class(YamlSection& section, const std::string& field, SemanticClass& label) {
  std::vector<YamlSection::Choice<SemanticClass>> classes;
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    const auto one = static_cast<SemanticClass>(i);
    classes.push_back({std::string(name(one)), one});
  }
  section.choice(field, label, classes);
}

/// Lines of 'output: class', from 0 without a gap.
void read_classes(YamlSection section, std::vector<SemanticClass>& classes) {
  const std::vector<std::string> written = section.names();
  if (written.empty() || written.size() > PixelOutputs::max_outputs) {
    section.faults("has " + std::to_string(written.size()) + " outputs; 1 to " +
                   std::to_string(PixelOutputs::max_outputs) + " can be used");
    return;
  }
  classes.assign(written.size(), SemanticClass::unlabeled);
  for (std::size_t i = 0; i < classes.size(); ++i) {
    const std::string output = std::to_string(i);
    if (std::ranges::find(written, output) == written.end()) {
      section.faults("output " + output + " has no class; outputs are numbered from 0 to " +
                     std::to_string(classes.size() - 1) + " without a gap");
    } else {
      read_class(section, output, classes[i]);
    }
  }
}

void read_knn(YamlSection section, std::optional<KnnConfig>& knn) {
  bool use = true;
  KnnConfig read;
  section.boolean("use", use);
  section.integer("neighbours", read.neighbours, {1, KnnConfig::max_neighbours});
  section.integer("window", read.window, {1, KnnConfig::max_window});
  section.number("sigma", read.sigma, {1e-3, 1e3});
  section.number("cutoff_m", read.cutoff_m, {1e-3, 1e3});
  section.boolean("car_without_votes", read.car_without_votes);
  section.faults(read.faults());
  if (use) knn = read;
}

void read_voxel_votes(YamlSection section, std::optional<VoxelVoteConfig>& votes) {
  bool use = true;
  VoxelVoteConfig read;
  section.boolean("use", use);
  section.number("edge_m", read.edge_m, {0.05, 10});
  section.number("height_m", read.height_m, {0.05, 10});
  section.number("neighbour_weight", read.neighbour_weight, {0, 1});
  section.number("own_weight", read.own_weight, {0, 1});
  if (use) votes = read;
}

void read_unsure_votes(YamlSection section, std::optional<UnsureVoteConfig>& votes) {
  bool use = true;
  UnsureVoteConfig read;
  section.boolean("use", use);
  section.number("edge_m", read.edge_m, {0.05, 10});
  section.number("height_m", read.height_m, {0.05, 10});
  section.number("neighbour_weight", read.neighbour_weight, {0, 1});
  section.number("unsure_below", read.unsure_below, {0, 1});
  section.number("unsure_small_below", read.unsure_small_below, {0, 1});
  section.number("small_weight", read.small_weight, {1e-3, 1e3});
  if (use) votes = read;
}

void read_island_votes(YamlSection section, std::optional<IslandVoteConfig>& votes) {
  bool use = true;
  IslandVoteConfig read;
  section.boolean("use", use);
  section.number("edge_m", read.edge_m, {0.05, 10});
  section.number("share", read.share, {1e-3, 1e3});
  if (use) votes = read;
}

std::optional<TrainedSensors> read_trained_for(YamlSection section) {
  TrainedSensors seen;
  section.require({"min_beams", "max_beams", "fov_up_deg", "fov_down_deg"});
  section.integer("min_beams", seen.min_rings, {1, 512});
  section.integer("max_beams", seen.max_rings, {static_cast<double>(seen.min_rings), 512});
  section.degrees("fov_up_deg", seen.fov_up, {-90, 90});
  section.degrees("fov_down_deg", seen.fov_down, {-90, 90});
  if (seen.fov_up <= seen.fov_down) section.fault("fov_down_deg", "must be below fov_up_deg");
  return seen;
}

/// What stands in lines of logs, of the status and of terminals. Blanks and line ends around it, as
/// a folded text of YAML has one, are no part of it.
void read_line(YamlSection& file, const std::string& field, std::string& line) {
  std::string text;
  if (!file.text(field, text)) return;
  constexpr std::string_view blanks = " \t\r\n";
  const std::size_t first = std::min(text.find_first_not_of(blanks), text.size());
  line = text.substr(first, text.find_last_not_of(blanks) + 1 - first);
  if (line.empty()) {
    file.fault(field, "must not be empty");
  } else if (dds::shown_text(line, line.size()) != line) {
    file.fault(field, "must be one line of characters that can be shown");
  }
}

void read_model(YamlSection file, ModelDescription& model) {
  file.require({"name", "licence", "image", "statistics", "classes"});
  read_line(file, "name", model.name);
  read_line(file, "licence", model.licence);
  file.text("sensor", model.sensor);
  file.text("training", model.training);
  file.text("accuracy", model.accuracy);
  if (file.has("lidar_height_m")) {
    double height_m = 0.0;
    file.number("lidar_height_m", height_m, {0.1, 4.0});
    model.lidar_height_m = height_m;
  }
  if (file.has("trained_for")) model.trained_for = read_trained_for(file.section("trained_for"));
  read_image(file.section("image"), model);
  read_statistics(file.section("statistics"), model.statistics);
  read_classes(file.section("classes"), model.classes);
  read_knn(file.section("knn"), model.knn);
  if (file.has("voxel_votes")) read_voxel_votes(file.section("voxel_votes"), model.voxel_votes);
  if (file.has("unsure_votes")) {
    read_unsure_votes(file.section("unsure_votes"), model.unsure_votes);
  } else if (model.voxel_votes) {
    // As models had it that could not say.
    model.unsure_votes = UnsureVoteConfig{};
  }
  if (file.has("island_votes")) read_island_votes(file.section("island_votes"), model.island_votes);
  if (model.fov_up <= model.fov_down) file.fault("image", "fov_down_deg must be below fov_up_deg");
}

std::unique_ptr<Segmenter> open_network_labels(const LabelsConfig& labels,
                                               const SensorModel& sensor, bool adaptive_width,
                                               const LidarTilt& tilt) {
  ModelDescription model =
      for_sensor(load_model_description(find_model(labels.model)), sensor, tilt);
  model.finds_stance = labels.finds_stance;
  model.mirrored = labels.mirrored;
  if (labels.image_columns == 0) {
    return adaptive_width ? open_multi_resolution_model(model, labels.engine)
                          : open_model(model, labels.engine);
  }
  model.columns = labels.image_columns;
  try {
    return open_model(model, labels.engine);
  } catch (const ModelError& error) {
    throw ModelError("with " + std::to_string(labels.image_columns) + " image columns",
                     error.what());
  }
}

}  // namespace

std::string better_model(const LabelsConfig& labels, const SensorModel& sensor) {
  if (labels.source == LabelProvider::stream || labels.source == LabelProvider::none) return {};
  const ModelDescription used = load_uncalibrated_model(find_model(labels.model));
  ModelDescription best = used;
  for (const fs::path& folder : known_models()) {
    try {
      const ModelDescription other = load_uncalibrated_model(folder);
      if (fits_better(other, best, sensor)) best = other;
    } catch (const ConfigError&) {
      // Whoever names it is told what is wrong with it.
    }
  }
  if (best.name == used.name) return {};
  return "the model '" + best.name + "' (" + best.licence +
         ") was trained for lidars more like this one: " + in_words(*best.trained_for) + ", '" +
         used.name + "' for " + in_words(*used.trained_for);
}

ModelDescription load_uncalibrated_model(const fs::path& folder) {
  if (!fs::is_directory(folder)) {
    throw ConfigError({folder.string() +
                       ": is not a folder; a model is a folder with model.onnx and model.yaml"});
  }
  YamlFile yaml = open_yaml(folder / "model.yaml");
  ModelDescription model;
  model.network_file = folder / "model.onnx";
  read_model(YamlSection(yaml), model);
  yaml.require_no_faults();
  return model;
}

ModelDescription load_model_description(const fs::path& folder) {
  ModelDescription model = load_uncalibrated_model(folder);
  model.int8 = load_int8_calibration(folder / "int8.yaml");
  return model;
}

std::unique_ptr<Segmenter> open_segmenter(const LabelsConfig& labels, const SensorModel& sensor,
                                          bool adaptive_width,
                                          const Eigen::Isometry3d& T_base_lidar) {
  if (labels.source == LabelProvider::stream) return std::make_unique<PassthroughSegmenter>();
  if (labels.source == LabelProvider::none) return std::make_unique<NullSegmenter>();
  std::unique_ptr<Segmenter> segmenter =
      open_network_labels(labels, sensor, adaptive_width, LidarTilt(T_base_lidar.linear()));
  segmenter->set_mount(T_base_lidar);
  if (labels.source == LabelProvider::model) return segmenter;
  return std::make_unique<FallbackSegmenter>(std::move(segmenter));
}

}  // namespace stillmap
