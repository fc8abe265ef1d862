#include <iostream>
#include <memory>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/model/model_arguments.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/binary_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn_network.hpp"

namespace stillmap::cli {
namespace {

struct InfoArguments {
  ModelArguments model;
  bool steps = false;
};

std::string channels_in_words(std::size_t count) {
  std::string words;
  for (std::size_t i = 0; i < count; ++i) {
    words += (i > 0 ? ", " : "") + std::string(input_channel_names[i]);
  }
  return words;
}

std::string votes_in_words(const ModelDescription& model) {
  std::string words = "a point takes its pixel's class";
  if (model.knn) {
    words = std::to_string(model.knn->neighbours) + " nearest of " +
            std::to_string(model.knn->window) + "x" + std::to_string(model.knn->window) + " pixels";
  }
  if (model.voxel_votes) {
    words += ", then voxels of " + fixed(model.voxel_votes->edge_m, 2) + " m, " +
             fixed(model.voxel_votes->height_m, 2) + " m high";
  }
  if (model.unsure_votes) {
    words += ", then of the unsure in such of " + fixed(model.unsure_votes->edge_m, 2) + " m, " +
             fixed(model.unsure_votes->height_m, 2) + " m high";
  }
  if (model.island_votes) words += ", then around vehicles";
  return words;
}

void print_description(const ModelDescription& model) {
  const auto line = [](const char* what, const std::string& text) {
    if (!text.empty()) std::cout << what << text << "\n";
  };
  line("name      ", model.name);
  line("licence   ", model.licence);
  line("sensor    ", model.sensor);
  if (model.trained_for) line("trained   ", "for " + in_words(*model.trained_for));
  line("training  ", model.training);
  line("accuracy  ", model.accuracy);
  const std::string least = std::to_string(model.min_columns);
  line("image     ", std::to_string(model.rows) + "x" + std::to_string(model.columns) +
                         (model.min_columns > 0 ? ", down to " + least + " columns" : "") +
                         (model.follow_sensor ? ", rows half way to the sensor's rings" : ""));
  line("channels  ", channels_in_words(model.statistics.channels));
  line("outputs   ", std::to_string(model.classes.size()));
  line("votes     ", votes_in_words(model));
  line("int8      ", model.int8 ? "calibrated: " + model.int8->made : "not calibrated");
}

void print_engine(const OneDnnNetwork& network, bool steps) {
  std::cout << network.engine() << ": " << fixed(network.giga_operations(), 1)
            << " billion operations a scan, "
            << fixed(static_cast<double>(network.memory_bytes()) / 1e6, 0) << " MB\n";
  if (!steps) return;
  for (const std::string& step : network.steps()) std::cout << "  " << step << "\n";
}

ExitCode run(const InfoArguments& arguments) {
  const ModelDescription model = load_model(arguments.model);
  print_description(model);
  try {
    print_engine(OneDnnNetwork(model, Precision::fp32), arguments.steps);
    if (model.int8) print_engine(OneDnnNetwork(model, Precision::int8), arguments.steps);
  } catch (const UnsupportedModel& error) {
    std::cout << "not for the oneDNN engine: " << error.what() << "\n";
  }
  return ExitCode::ok;
}

struct RunArguments {
  ModelArguments model;
  EngineArguments engine;
  std::string input, output;
};

std::vector<float> read_images(const std::string& file, const ModelDescription& model) {
  const std::uintmax_t bytes = scan_file_size(file);
  const std::size_t bytes_an_image = model.input_size() * sizeof(float);
  if (bytes > 0 && bytes % bytes_an_image == 0) return read_values<float>(file);
  throw DatasetError(
      file, "has " + std::to_string(bytes) + " bytes, and an image of '" + model.name + "' has " +
                std::to_string(bytes_an_image) + ": " + std::to_string(model.statistics.channels) +
                " channels (" + channels_in_words(model.statistics.channels) + ") x " +
                std::to_string(model.rows) + " rows x " + std::to_string(model.columns) +
                " columns of 32-bit floats; write whole images of that size");
}

ExitCode run(const RunArguments& arguments) {
  const ModelDescription model = load_model(arguments.model);
  EngineOptions choice;
  set_engine(arguments.engine, choice);
  const OpenedNetwork opened = open_network(model, choice);
  const std::size_t values_an_image = model.input_size();
  const std::vector<float> images = read_images(arguments.input, model);
  std::vector<float> probabilities;
  for (std::size_t at = 0; at < images.size(); at += values_an_image) {
    const std::vector<float> of_image =
        opened.network->probabilities(std::span(images).subspan(at, values_an_image));
    probabilities.insert(probabilities.end(), of_image.begin(), of_image.end());
  }
  write_values<float>(arguments.output, probabilities);
  std::cerr << images.size() / values_an_image << " images on " << opened.network->engine()
            << (opened.remark.empty() ? "" : "; ") << opened.remark << "\n";
  return ExitCode::ok;
}

}  // namespace

void add_model_info_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<InfoArguments>();
  CommandHandle command = model.command("info", "What a model is, and what runs it");
  add_model_options(command, arguments->model);
  command.flag("--steps", arguments->steps, "List what is done in which order by what code");
  command.explain(
      "Examples:\n"
      "  stillmap model info street\n"
      "  stillmap model info some_network.onnx --columns 2048 --steps");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_model_run_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<RunArguments>();
  CommandHandle command = model.command("run", "Run normalised range images through a network");
  add_model_options(command, arguments->model);
  add_engine_options(command, arguments->engine);
  command
      .option(
          "--input", arguments->input,
          "Images, one after the other: channels x rows x columns of 32-bit floats (little-endian)")
      .required();
  command
      .option("--output,--out,-o", arguments->output,
              "File for the probabilities: classes x rows x columns of 32-bit floats an image")
      .required();
  command.explain(
      "Example:\n"
      "  stillmap model run my_model --engine onednn --precision int8 --input x.f32 --output "
      "y.f32\n"
      "Channels are those that 'stillmap model info' lists, normalised as model.yaml says, 0 where "
      "a pixel is empty. For comparing engines with the framework that trained the network.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
