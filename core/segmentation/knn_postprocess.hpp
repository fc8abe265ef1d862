#pragma once

#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/range_image.hpp"

namespace stillmap {

/// RangeNet++'s post-processing: a point that is hidden behind another one in its pixel must not
/// take that one's class, so the pixels around it vote.
struct KnnConfig {
  static constexpr int max_neighbours = 25;
  static constexpr int max_window = 15;

  /// Number of pixels that vote, and the edge length (odd) of the square they are searched in.
  int neighbours = 5;
  int window = 5;
  /// Standard deviation in pixels of the Gaussian that favours pixels near the point's own.
  double sigma = 1.0;
  /// Pixels at a larger (weighted) difference in range do not vote [m].
  double cutoff_m = 1.0;
  /// A point without any vote becomes a car, as in lidar-bonnetal, instead of its pixel's class.
  /// For parity tests.
  bool car_without_votes = false;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// Class and confidence of every pixel of a range image, row by row.
struct PixelLabels {
  std::vector<SemanticClass> classes;
  std::vector<float> confidence;
};

/// The class of every point by majority vote of the `neighbours` pixels nearest in range, within
/// the window around its pixel. The distance of a pixel is |its range - the point's| (1 -
/// Gaussian); among equal distances the window's order decides. `unlabeled` never wins; ties go to
/// the lowest class. The confidence is the sum over the winning votes, divided by the number of all
/// votes. Points without a pixel are unlabeled.
[[nodiscard]] PointLabels knn_labels(const RangeImage& image, const PixelLabels& pixels,
                                     const KnnConfig& config);

}  // namespace stillmap
