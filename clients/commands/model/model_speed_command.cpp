#include <charconv>
#include <iostream>
#include <memory>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "clients/commands/model/benchmark_scan.hpp"
#include "clients/commands/model/model_arguments.hpp"
#include "clients/commands/model/model_timing.hpp"
#include "clients/terminal/table.hpp"
#include "core/segmentation/model_error.hpp"
#include "idl/bag/bag_scan_source.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::vector<std::string> models;
  std::vector<std::string> columns{"1024"};
  std::string dataset;
  std::uint32_t threads = 0;
  bool skip_opencv = false;
};

std::uint32_t whole_number(const std::string& text) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error == std::errc() && end == text.data() + text.size() && number > 0) return number;
  throw std::invalid_argument("--columns: '" + text + "' is no number of columns");
}

std::vector<std::string> row(const ModelDescription& model, const std::string& engine,
                             const SegmentationTiming& timing) {
  const double total = timing.projection_ms + timing.network_ms + timing.knn_ms;
  return {model.name,
          std::to_string(model.rows) + "x" + std::to_string(model.columns),
          engine,
          fixed(timing.projection_ms, 1),
          fixed(timing.network_ms, 1),
          fixed(timing.knn_ms, 1),
          fixed(total, 1),
          fixed(timing.gops, 0),
          fixed(timing.peak_gops, 0),
          fixed(100.0 * timing.gops / timing.peak_gops, 0),
          fixed(timing.memory_mb, 0)};
}

void time_model(const ModelDescription& model, const Scan& scan, const Arguments& arguments,
                Table& table) {
  const auto threads = static_cast<int>(arguments.threads);
  const double giga_operations = OneDnnNetwork(model, Precision::fp32, threads).giga_operations();
  for (const TimedEngine& engine : timed_engines(model, scan, threads)) {
    if (arguments.skip_opencv && engine.name.starts_with("OpenCV")) continue;
    std::cerr << "stillmap: timing " << model.name << ", " << model.columns << " columns, "
              << engine.name << "\n";
    table.add(
        row(model, engine.name, time_segmentation(model, engine, scan, giga_operations, threads)));
  }
}

ExitCode run(const Arguments& arguments) {
  const Scan scan = arguments.dataset.empty() ? benchmark_scan()
                                              : dds::open_sequence(arguments.dataset).read(0).scan;
  Table table({"network", "image", "engine", "project ms", "network ms", "k-NN ms", "total ms",
               "Gop/s", "peak", "%", "MB"});
  for (const std::string& model_path : arguments.models) {
    for (const std::string& columns : arguments.columns) {
      const ModelDescription model =
          load_model({.model = model_path, .rows = 0, .columns = whole_number(columns)});
      try {
        time_model(model, scan, arguments, table);
      } catch (const ModelError& error) {
        std::cerr << "stillmap: left out: " << error.what() << "\n";
      }
    }
  }
  std::cout << table.text() << "Medians for a scan of " << scan.size()
            << " points. peak: a matrix product of oneDNN just before, in the same numbers.\n"
            << "MB: growth of the process by the network.\n";
  return ExitCode::ok;
}

}  // namespace

void add_model_speed_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command =
      model.command("speed", "Time projection, network and k-NN on every engine");
  command.option("MODEL", arguments->models, "Model folders or ONNX files").required();
  command.option("--columns", arguments->columns, "Columns of the image: 512,1024,2048")
      .comma_separated()
      .with_default();
  command.option("--dataset", arguments->dataset,
                 "Recording whose first scan is taken; default: one of 64 x 1900 made-up points");
  command.option("--threads", arguments->threads, "Threads of oneDNN; default: all")
      .between(0, 1024);
  command.flag("--skip-opencv", arguments->skip_opencv, "Leave the slow reference engine out");
  command.explain(
      "Examples:\n"
      "  stillmap model speed street --columns 512,1024,2048\n"
      "  stillmap model speed rangenet21.onnx rangenet53.onnx --columns 2048 --skip-opencv\n"
      "Run it on an idle machine.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
