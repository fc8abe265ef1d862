#include <malloc.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fstream>
#include <functional>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/commands/command.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/commands/model/benchmark_scan.hpp"
#include "clients/commands/model/model_arguments.hpp"
#include "clients/commands/model/speed_beside_load.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/lidar/range_image.hpp"
#include "core/lidar/ranked_value.hpp"
#include "core/lidar/scan.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/network_input.hpp"
#include "core/segmentation/network_segmenter.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/opencv_network.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap::cli {
namespace {

/// Medians of the stages from a scan to the classes of its points [ms].
struct SegmentationTiming {
  double projection_ms = 0.0;
  double network_ms = 0.0;
  double votes_ms = 0.0;
  /// Operations a second of the network, and of a matrix product just before [10^9].
  double gops = 0.0;
  double peak_gops = 0.0;
  /// Growth of the process by the network [MB].
  double memory_mb = 0.0;
};

/// An engine to be timed, opened by `open`.
struct TimedEngine {
  std::string name;
  Precision precision = Precision::fp32;
  std::function<std::unique_ptr<SegmentationNetwork>()> open;
};

using Clock = std::chrono::steady_clock;

double ms_of(const std::function<void()>& work) {
  const auto began = Clock::now();
  work();
  return std::chrono::duration<double, std::milli>(Clock::now() - began).count();
}

Int8Calibration calibrate_on(const ModelDescription& model, const std::vector<float>& input) {
  ActivationRanges ranges;
  OneDnnNetwork(model, Precision::fp32)
      .observe(input, [&ranges](const std::string& tensor, auto values, std::size_t channels) {
        ranges.add(tensor, values, channels);
      });
  return {.made = "one scan", .range_of_channels = ranges.ranges(1.0), .float_layers = {}};
}

/// Median of how long `work` takes [ms], once warm: 5 to 40 runs, about two seconds.
double median_ms(const std::function<void()>& work) {
  constexpr double target_ms = 2000.0;
  constexpr std::size_t min_runs = 5, max_runs = 40;
  work();
  std::vector<double> times;
  double total = 0.0;
  while (times.size() < min_runs || (total < target_ms && times.size() < max_runs)) {
    times.push_back(ms_of(work));
    total += times.back();
  }
  return median_of(times);
}

/// Speed of a large matrix product on this machine [10^9 operations a second].
double peak_gops(Precision precision, int threads) {
  constexpr int runs = 8;
  MatrixProduct product(precision, threads);
  double fastest_ms = ms_of([&] { product.run(); });
  for (int i = 0; i < runs; ++i) fastest_ms = std::min(fastest_ms, ms_of([&] { product.run(); }));
  return MatrixProduct::giga_operations() / fastest_ms * 1e3;
}

/// Resident memory of this process [MB], after freed memory was returned to the system.
double resident_mb() {
  malloc_trim(0);
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kb = 0.0;
    if (word == "VmRSS:" && status >> kb) return kb / 1e3;
  }
  return 0.0;
}

/// OpenCV, oneDNN in fp32 and in int8; a model that is not calibrated is calibrated on `scan`,
/// which does not change how long it takes.
std::vector<TimedEngine> timed_engines(const ModelDescription& model, const Scan& scan,
                                       int threads) {
  ModelDescription calibrated = model;
  if (!model.int8) {
    const RangeImage image(scan.points_lidar, model.projection());
    calibrated.int8 = calibrate_on(model, make_network_input(scan, image, model));
  }
  const auto onednn = [threads](const ModelDescription& which, Precision precision) {
    return [which, precision, threads]() -> std::unique_ptr<SegmentationNetwork> {
      return std::make_unique<OneDnnNetwork>(which, precision, threads);
    };
  };
  return {{"OpenCV fp32", Precision::fp32,
           [model]() -> std::unique_ptr<SegmentationNetwork> {
             return std::make_unique<OpenCvNetwork>(model);
           }},
          {"oneDNN fp32", Precision::fp32, onednn(model, Precision::fp32)},
          {"oneDNN int8", Precision::int8, onednn(calibrated, Precision::int8)}};
}

/// `giga_operations`: operations of the network for one scan.
SegmentationTiming time_segmentation(const ModelDescription& model, const TimedEngine& engine,
                                     const Scan& scan, double giga_operations, int threads) {
  SegmentationTiming timing;
  timing.peak_gops = peak_gops(engine.precision, threads);
  const auto project = [&] {
    const RangeImage image(scan.points_lidar, model.projection());
    return make_network_input(scan, image, model);
  };
  timing.projection_ms = median_ms([&] { (void)project(); });
  const std::vector<float> input = project();
  const double before_mb = resident_mb();
  const std::unique_ptr<SegmentationNetwork> network = engine.open();
  PixelOutputs outputs;
  timing.network_ms = median_ms([&] { outputs = network->run(input); });
  timing.memory_mb = resident_mb() - before_mb;
  timing.gops = giga_operations / timing.network_ms * 1e3;
  const RangeImage image(scan.points_lidar, model.projection());
  const PixelLabels pixels = pixel_labels(std::move(outputs), model);
  timing.votes_ms = median_ms([&] { (void)voted_labels(image, pixels, scan.points_lidar, model); });
  return timing;
}

struct ModelSpeedArguments {
  std::vector<std::string> models;
  std::vector<std::string> columns{"1024"};
  std::string dataset;
  std::string topic_in;
  std::uint32_t threads = 0;
  std::vector<std::string> beside;
  bool skip_opencv = false;
};

/// What a list holds, each from 1 to `max`.
std::uint32_t whole_number(const std::string& option, const std::string& text, std::uint32_t max) {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_number = error == std::errc() && end == text.data() + text.size();
  if (is_number && number > 0 && number <= max) return number;
  throw std::invalid_argument(option + ": '" + text + "' is no number from 1 to " +
                              std::to_string(max));
}

std::vector<std::string> row(const ModelDescription& model, const std::string& engine,
                             const SegmentationTiming& timing) {
  const double total = timing.projection_ms + timing.network_ms + timing.votes_ms;
  return {model.name,
          std::to_string(model.rows) + "x" + std::to_string(model.columns),
          engine,
          fixed(timing.projection_ms, 1),
          fixed(timing.network_ms, 1),
          fixed(timing.votes_ms, 1),
          fixed(total, 1),
          fixed(timing.gops, 0),
          fixed(timing.peak_gops, 0),
          fixed(100.0 * timing.gops / timing.peak_gops, 0),
          fixed(timing.memory_mb, 0)};
}

void time_model(const ModelDescription& model, const Scan& scan,
                const ModelSpeedArguments& arguments, Table& table) {
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

/// In words for a table.
std::string layout(const SpeedBesideLoad& speed, std::size_t threads) {
  return speed.parallelism == Parallelism::within_scan
             ? "1 scan on " + std::to_string(threads) + " threads"
             : std::to_string(threads) + " scans on 1 thread each";
}

void time_beside_load(const ModelDescription& model, const Scan& scan,
                      const std::vector<std::size_t>& loops, Table& table) {
  constexpr int rounds = 5;
  constexpr double turn_s = 1.0;
  const std::unique_ptr<Segmenter> segmenter = open_model(model);
  const std::size_t threads = segmenter->concurrent_scans();
  if (threads < 2) {
    throw ModelError(model.network_file,
                     "has one thread here, so there is no choice to measure: --beside needs two "
                     "cores and a network that oneDNN runs");
  }
  std::cerr << "stillmap: timing " << model.name << ", " << model.columns
            << " columns, beside busy loops\n";
  for (const SpeedBesideLoad& speed :
       measure_beside_load(*segmenter, scan, loops, rounds, turn_s)) {
    const auto scans = static_cast<double>(speed.scans);
    table.add({model.name, std::to_string(model.rows) + "x" + std::to_string(model.columns),
               std::to_string(speed.loops), layout(speed, threads), fixed(speed.scan_ms, 1),
               fixed(scans / speed.wall_s, 1), fixed(1e3 * speed.cpu_s / scans, 1),
               fixed(speed.of_fair_share, 2)});
  }
}

ExitCode run_beside_load(const ModelSpeedArguments& arguments, const Scan& scan) {
  constexpr std::uint32_t max_loops = 64;
  std::vector<std::size_t> loops{0};
  for (const std::string& count : arguments.beside)
    loops.push_back(whole_number("--beside", count, max_loops));
  Table table({"network", "image", "busy loops", "layout", "scan ms", "scans/s", "CPU ms a scan",
               "of fair share"});
  for (const std::string& model_path : arguments.models) {
    for (const std::string& columns : arguments.columns) {
      const std::uint32_t width = whole_number("--columns", columns, max_image_columns);
      time_beside_load(load_model({.model = model_path, .rows = 0, .columns = width}), scan, loops,
                       table);
    }
  }
  std::cout << table.text()
            << "scan ms: median from a scan to its labels. of fair share: scans a second, relative "
               "to as\nmany threads that get as much of the cores as each loop, and use it as the "
               "better layout does\nalone. The server chooses between the layouts as it runs.\n";
  return ExitCode::ok;
}

ExitCode run(const ModelSpeedArguments& arguments) {
  // A packed bag is unpacked.
  if (!arguments.dataset.empty()) end_cleanly_when_stopped();
  const Scan scan = arguments.dataset.empty()
                        ? benchmark_scan()
                        : open_recording(arguments.dataset, arguments.topic_in).read(0).scan;
  if (!arguments.beside.empty()) return run_beside_load(arguments, scan);
  Table table({"network", "image", "engine", "project ms", "network ms", "votes ms", "total ms",
               "Gop/s", "peak", "%", "MB"});
  std::vector<std::uint32_t> widths;
  for (const std::string& columns : arguments.columns)
    widths.push_back(whole_number("--columns", columns, max_image_columns));
  bool is_any_timed = false;
  for (const std::string& model_path : arguments.models) {
    for (const std::uint32_t columns : widths) {
      const ModelDescription model =
          load_model({.model = model_path, .rows = 0, .columns = columns});
      try {
        time_model(model, scan, arguments, table);
        is_any_timed = true;
      } catch (const ModelError& error) {
        std::cerr << "stillmap: skipped: " << error.what() << "\n";
      }
    }
  }
  if (!is_any_timed) return ExitCode::bad_input;
  std::cout << table.text() << "Medians for a scan of " << scan.size()
            << " points. peak: a matrix product of oneDNN just before, in the same numbers.\n"
            << "MB: growth of the process by the network.\n";
  return ExitCode::ok;
}

}  // namespace

void add_model_speed_command(CommandHandle model, Action& action) {
  auto arguments = std::make_shared<ModelSpeedArguments>();
  CommandHandle command =
      model.command("speed", "Time projection, network and votes on every engine");
  command.option("MODEL", arguments->models, "Model folders or ONNX files").required();
  command.option("--columns", arguments->columns, "Columns of the image: 512,1024,2048")
      .comma_separated()
      .with_default();
  const OptionHandle dataset = command.option(
      "--dataset", arguments->dataset,
      "Data set or bag whose first scan is taken; default: one of 64 x 1900 made-up points");
  command.option("--topic-in", arguments->topic_in, topic_in_help).needs(dataset);
  const OptionHandle threads =
      command.option("--threads", arguments->threads, "Threads of oneDNN; default: all")
          .between(0, 1024);
  command
      .option(
          "--beside", arguments->beside,
          "Numbers of busy loops: time from scan to labels and scans a second beside them, with "
          "all threads on one scan and with a scan on each, oneDNN alone: 1,2,4")
      .comma_separated()
      .excludes(threads);
  command.flag("--skip-opencv", arguments->skip_opencv, "Leave the slow reference engine out");
  command.explain(
      "Examples:\n"
      "  stillmap model speed street --columns 512,1024,2048\n"
      "  stillmap model speed rangenet21.onnx rangenet53.onnx --columns 2048 --skip-opencv\n"
      "  stillmap model speed street --columns 2048 --beside 1,2,4\n"
      "Run it on an idle machine.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
