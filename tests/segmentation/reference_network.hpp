#pragma once

#include <span>
#include <vector>

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap::test {

/// Values of one tensor, channels x rows x columns.
struct ReferenceTensor {
  ImageShape shape;
  std::vector<double> values;

  [[nodiscard]] double& at(int channel, int row, int column);
  /// 0 outside.
  [[nodiscard]] double get(int channel, int row, int column) const;
};

/// Runs a network as its layers are defined, in double precision, without any trick: what every
/// rearrangement of it must agree with. Shapes are inferred anew.
[[nodiscard]] ReferenceTensor run_reference(NetworkGraph graph, const ImageShape& shape,
                                            std::span<const float> input);

}  // namespace stillmap::test
