#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// Where the class of a point comes from: a recording's labels, a network, or nowhere.
class Segmenter {
 public:
  virtual ~Segmenter() = default;

  /// Name for the status: "stream", "none", or the model's name.
  [[nodiscard]] virtual std::string name() const = 0;

  /// How it works, in words for a log; empty when there is nothing to say.
  [[nodiscard]] virtual std::string details() const { return {}; }

  /// Time that a scan takes at each resolution level that this source knows, as a share of the
  /// finest's, which comes first; the others are less, each less than the one before.
  [[nodiscard]] virtual std::vector<double> relative_costs() const { return {1.0}; }
  /// How coarsely to look at the next scans: an index of relative_costs().
  virtual void set_resolution_level(std::size_t /*resolution_level*/) {}
  /// Width of the range images that it looks at now; 0: it looks at none.
  [[nodiscard]] virtual int image_columns() const { return 0; }

  /// Classes of the scan's points; empty when this source has none for this scan.
  [[nodiscard]] virtual PointLabels segment(const Scan& scan) = 0;
};

}  // namespace stillmap
