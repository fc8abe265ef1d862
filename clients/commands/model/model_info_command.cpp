#include <iostream>
#include <memory>

#include "clients/commands/command.hpp"
#include "clients/commands/model/model_arguments.hpp"
#include "clients/terminal/table.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn_network.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  ModelArguments model;
  bool steps = false;
};

void print_description(const ModelDescription& model) {
  const auto line = [](const char* what, const std::string& text) {
    if (!text.empty()) std::cout << what << text << "\n";
  };
  line("name      ", model.name);
  line("licence   ", model.licence);
  line("sensor    ", model.sensor);
  line("training  ", model.training);
  line("accuracy  ", model.accuracy);
  const std::string least = std::to_string(model.min_columns);
  line("image     ", std::to_string(model.rows) + "x" + std::to_string(model.columns) +
                         (model.min_columns > 0 ? ", down to " + least + " columns" : "") +
                         (model.follow_sensor ? ", rows as the sensor has rings" : ""));
  line("outputs   ", std::to_string(model.classes.size()));
  line("int8      ", model.int8 ? "calibrated: " + model.int8->made : "not calibrated");
}

void print_engine(const OneDnnNetwork& network, bool steps) {
  std::cout << network.engine() << ": " << fixed(network.giga_operations(), 1)
            << " billion operations a scan, "
            << fixed(static_cast<double>(network.memory_bytes()) / 1e6, 0) << " MB\n";
  if (!steps) return;
  for (const std::string& step : network.steps()) std::cout << "  " << step << "\n";
}

ExitCode run(const Arguments& arguments) {
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

}  // namespace

void add_model_info_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = model.command("info", "What a model is, and what runs it");
  add_model_options(command, arguments->model);
  command.flag("--steps", arguments->steps, "List what is done in which order by what code");
  command.explain(
      "Examples:\n"
      "  stillmap model info street\n"
      "  stillmap model info some_network.onnx --columns 2048 --steps");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
