#include "clients/commands/model/model_timing.hpp"

#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <fstream>

#include "core/lidar/range_image.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/network_input.hpp"
#include "core/segmentation/network_segmenter.hpp"
#include "core/segmentation/opencv_network.hpp"

namespace stillmap::cli {
namespace {

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

}  // namespace

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
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::ranges::nth_element(times, middle);
  return *middle;
}

double peak_gops(Precision precision, int threads) {
  constexpr int runs = 8;
  MatrixProduct product(precision, threads);
  double fastest_ms = ms_of([&] { product.run(); });
  for (int i = 0; i < runs; ++i) fastest_ms = std::min(fastest_ms, ms_of([&] { product.run(); }));
  return MatrixProduct::giga_operations() / fastest_ms * 1e3;
}

double resident_mb() {
  malloc_trim(0);
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    double kb = 0.0;
    if (word == "VmRSS:" && status >> kb) return kb / 1e3;
  }
  return 0.0;
}

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
  const KnnConfig knn = model.knn.value_or(KnnConfig{});
  timing.knn_ms = median_ms([&] { (void)knn_labels(image, pixels, knn); });
  return timing;
}

}  // namespace stillmap::cli
