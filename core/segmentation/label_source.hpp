#pragma once

#include <string>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// Where the class of a point comes from: a recording's labels, a network, or nowhere.
class LabelSource {
 public:
  virtual ~LabelSource() = default;

  /// Name for the status: "stream", "none", or the model's name.
  [[nodiscard]] virtual std::string name() const = 0;

  /// How it works, in words for a log; empty when there is nothing to say.
  [[nodiscard]] virtual std::string details() const { return {}; }

  /// Classes of the scan's points; empty when this source has none for this scan.
  [[nodiscard]] virtual PointLabels label(const Scan& scan) = 0;
};

}  // namespace stillmap
