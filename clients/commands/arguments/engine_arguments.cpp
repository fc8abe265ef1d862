#include "clients/commands/arguments/engine_arguments.hpp"

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
  command.option("--threads", arguments.threads, "Threads of oneDNN for one scan; default: all")
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

}  // namespace stillmap::cli
