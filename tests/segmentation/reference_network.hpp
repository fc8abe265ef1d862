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
  /// 0 outside the image.
  [[nodiscard]] double get(int channel, int row, int column) const;
};

/// Runs a network layer by layer as they are defined, in double precision: the oracle for all
/// passes and engines. Infers the shapes itself.
[[nodiscard]] ReferenceTensor run_reference(NetworkGraph graph, const ImageShape& shape,
                                            std::span<const float> input);

}  // namespace stillmap::test
