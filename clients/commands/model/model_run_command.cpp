#include <iostream>
#include <memory>

#include "clients/commands/arguments/engine_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/model/model_arguments.hpp"
#include "core/dataset/binary_file.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  ModelArguments model;
  EngineArguments engine;
  std::string input, output;
};

ExitCode run(const Arguments& arguments) {
  const ModelDescription model = load_model(arguments.model);
  EngineOptions choice;
  set_engine(arguments.engine, choice);
  const OpenedNetwork opened = open_network(model, choice);
  const std::size_t values_an_image = input_channels * static_cast<std::size_t>(model.rows) *
                                      static_cast<std::size_t>(model.columns);
  const std::vector<float> images = read_values<float>(arguments.input, values_an_image);
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

void add_model_run_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = model.command("run", "Run normalised range images through a network");
  add_model_options(command, arguments->model);
  add_engine_options(command, arguments->engine);
  command
      .option("--input", arguments->input,
              "Images, one after the other: 5 x rows x columns of 32-bit floats (little-endian)")
      .required();
  command
      .option("--output", arguments->output,
              "File for the probabilities: classes x rows x columns of 32-bit floats an image")
      .required();
  command.explain(
      "Example:\n"
      "  stillmap model run my_model --engine onednn --precision int8 --input x.f32 --output "
      "y.f32\n"
      "Channels are range, x, y, z, remission, normalised as model.yaml says, 0 where a pixel is\n"
      "empty. For comparing engines with the framework that trained the network.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
