#pragma once

#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/range_image.hpp"

namespace stillmap {

/// RangeNet++'s post-processing: a point behind another one in its pixel must not take that one's
/// class, so the points around it vote.
struct KnnConfig {
  static constexpr int max_neighbours = 25;
  static constexpr int max_window = 15;

  /// Pixels that vote, and the edge of the square in which they are looked for (odd).
  int neighbours = 5;
  int window = 5;
  /// Width in pixels of the Gaussian that favours pixels near the point's own.
  double sigma = 1.0;
  /// A pixel farther than this in (weighted) range does not vote [m].
  double cutoff_m = 1.0;
  /// Without any vote a point becomes a car, as in lidar-bonnetal, and not what its pixel is. For
  /// parity tests.
  bool car_without_votes = false;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// Class and confidence of every pixel of a range image, row by row.
struct PixelLabels {
  std::vector<SemanticClass> classes;
  std::vector<float> confidence;
};

/// The class of every point by vote of the `neighbours` pixels nearest in range to it, out of the
/// window round its pixel. The distance of a pixel is |its range - the point's| (1 - Gaussian);
/// equal ones count in the window's order. `unlabeled` never wins; ties go to the lowest class. The
/// confidence is the winners' summed confidence over the number of all votes. Points without a
/// pixel are unlabeled.
[[nodiscard]] PointLabels knn_labels(const RangeImage& image, const PixelLabels& pixels,
                                     const KnnConfig& config);

}  // namespace stillmap
