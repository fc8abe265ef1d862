#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap::cli {

/// Median of how long `work` takes [ms], once warm: 5 to 40 runs, about two seconds.
[[nodiscard]] double median_ms(const std::function<void()>& work);

/// What the machine reaches now in a large matrix product [10^9 operations a second].
[[nodiscard]] double peak_gops(Precision precision, int threads);

/// Resident memory of this process [MB], what was freed given back first.
[[nodiscard]] double resident_mb();

/// Medians of the stages from a scan to the classes of its points [ms].
struct SegmentationTiming {
  double projection_ms = 0.0;
  double network_ms = 0.0;
  double knn_ms = 0.0;
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

/// OpenCV, oneDNN in fp32 and in int8; a model that is not calibrated is calibrated on `scan`,
/// which does not change how long it takes.
[[nodiscard]] std::vector<TimedEngine> timed_engines(const ModelDescription& model,
                                                     const Scan& scan, int threads);

/// `giga_operations`: of the network for one scan.
[[nodiscard]] SegmentationTiming time_segmentation(const ModelDescription& model,
                                                   const TimedEngine& engine, const Scan& scan,
                                                   double giga_operations, int threads);

}  // namespace stillmap::cli
