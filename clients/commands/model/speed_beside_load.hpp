#pragma once

#include <cstddef>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {

/// What a segmenter did beside so many busy loops.
struct SpeedBesideLoad {
  std::size_t loops = 0;
  Parallelism parallelism = Parallelism::within_scan;
  std::size_t scans = 0;
  double wall_s = 0.0;
  /// Processor time of the segmenter.
  double cpu_s = 0.0;
  /// Processor time that this process's cores gave to the segmenter and to the loops, or left idle;
  /// other programs have the rest.
  double available_s = 0.0;
  /// Median from a scan to its labels.
  double scan_ms = 0.0;
  /// Scans a second, relative to those of as many threads that get as much of the cores as every
  /// loop, and make as much of it as the better parallelism without loops does.
  double of_fair_share = 0.0;
};

/// Runs `segmenter` on `scan` beside each number of busy loops, which are threads of this process,
/// in both parallelisms: in `rounds` turns of `turn_s` each, so that other programs meet all alike.
/// `loops` begins with 0.
[[nodiscard]] std::vector<SpeedBesideLoad> measure_beside_load(
    Segmenter& segmenter, const Scan& scan, const std::vector<std::size_t>& loops, int rounds,
    double turn_s);

}  // namespace stillmap::cli
