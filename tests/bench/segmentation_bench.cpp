#include <benchmark/benchmark.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "clients/commands/model/benchmark_scan.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/network_input.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/open_network.hpp"
#include "core/segmentation/opencv_network.hpp"
#include "core/segmentation/pixel_scores.hpp"
#include "tests/segmentation/onnx_builder.hpp"

namespace stillmap {
namespace {

constexpr int rows = 64, columns = 1024, classes = 20;

/// A light network with random weights, calibrated on one image.
const ModelDescription& model() {
  static const ModelDescription made = [] {
    const auto file = std::filesystem::temp_directory_path() / "stillmap_segmentation_bench.onnx";
    std::ofstream(file, std::ios::binary) << test::light_bytes(32, rows, columns, classes);
    ModelDescription model = describe_bare_network(file, rows, columns);
    ActivationRanges ranges;
    OneDnnNetwork(model, Precision::fp32)
        .observe(trial_input(model),
                 [&](const std::string& name, auto values, std::size_t channels) {
                   ranges.add(name, values, channels);
                 });
    model.int8 =
        Int8Calibration{.made = "", .range_of_channels = ranges.ranges(1.0), .float_layers = {}};
    return model;
  }();
  return made;
}

void project(benchmark::State& state) {
  const Scan scan = cli::benchmark_scan();
  for (auto _ : state) {
    const RangeImage image(scan.points_lidar, model().projection());
    benchmark::DoNotOptimize(make_network_input(scan, image, model()));
  }
}
BENCHMARK(project)->Unit(benchmark::kMillisecond)->UseRealTime();

void run_network(benchmark::State& state, SegmentationNetwork&& network) {
  const std::vector<float> input = trial_input(model());
  for (auto _ : state) benchmark::DoNotOptimize(network.run(input));
}

void opencv(benchmark::State& state) { run_network(state, OpenCvNetwork(model())); }
void onednn_fp32(benchmark::State& state) {
  run_network(state, OneDnnNetwork(model(), Precision::fp32));
}
void onednn_int8(benchmark::State& state) {
  run_network(state, OneDnnNetwork(model(), Precision::int8));
}
BENCHMARK(opencv)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(onednn_fp32)->Unit(benchmark::kMillisecond)->UseRealTime();
BENCHMARK(onednn_int8)->Unit(benchmark::kMillisecond)->UseRealTime();

void best_class_of_pixels(benchmark::State& state) {
  std::mt19937 random(1);
  std::normal_distribution<float> any(0.0F, 3.0F);
  std::vector<float> scores(static_cast<std::size_t>(rows * columns * classes));
  for (float& score : scores) score = any(random);
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        argmax_outputs(scores, classes, ScoreKind::logits, ScoreLayout::pixels));
  }
}
BENCHMARK(best_class_of_pixels)->Unit(benchmark::kMillisecond)->UseRealTime();

void votes(benchmark::State& state) {
  const Scan scan = cli::benchmark_scan();
  const RangeImage image(scan.points_lidar, model().projection());
  PixelLabels pixels;
  for (std::size_t i = 0; i < image.pixel_count(); ++i) {
    pixels.classes.push_back(static_cast<SemanticClass>(1 + i / 37 % 19));
    pixels.confidence.push_back(0.5F);
  }
  for (auto _ : state) benchmark::DoNotOptimize(knn_labels(image, pixels, {}));
}
BENCHMARK(votes)->Unit(benchmark::kMillisecond)->UseRealTime();

void votes_in_voxels(benchmark::State& state) {
  const Scan scan = cli::benchmark_scan();
  PointLabels labels;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    labels.classes.push_back(static_cast<SemanticClass>(1 + i / 37 % 19));
    labels.confidence.push_back(0.5F);
  }
  for (auto _ : state) {
    PointLabels voted = labels;
    vote_in_voxels(scan.points_lidar, {}, voted);
    benchmark::DoNotOptimize(voted);
  }
}
BENCHMARK(votes_in_voxels)->Unit(benchmark::kMillisecond)->UseRealTime();

void votes_where_unsure(benchmark::State& state) {
  const Scan scan = cli::benchmark_scan();
  PointLabels labels;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    labels.classes.push_back(static_cast<SemanticClass>(1 + i / 37 % 19));
    // As many as in real scans, in stretches as there.
    labels.confidence.push_back(i / 400 % 14 == 0 ? 0.3F : 0.8F);
  }
  for (auto _ : state) {
    PointLabels voted = labels;
    vote_where_unsure(scan.points_lidar, {}, voted);
    benchmark::DoNotOptimize(voted);
  }
}
BENCHMARK(votes_where_unsure)->Unit(benchmark::kMillisecond)->UseRealTime();

}  // namespace
}  // namespace stillmap
