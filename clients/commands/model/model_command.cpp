#include "clients/commands/command.hpp"

namespace stillmap::cli {

void add_model_command(CommandHandle program, Action& action) {
  CommandHandle model = program.command(
      "model", "Look at a network, calibrate it for int8, compare and time its engines");
  model.require_command();
  add_model_info_command(model, action);
  add_model_calibrate_command(model, action);
  add_model_agree_command(model, action);
  add_model_speed_command(model, action);
  add_model_run_command(model, action);
  model.explain(
      "A model is a folder with model.onnx, model.yaml and, to run in int8, int8.yaml.\n"
      "'stillmap model STEP --help' shows options and examples.");
}

}  // namespace stillmap::cli
