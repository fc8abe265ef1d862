#pragma once

#include <vector>

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/onednn/execution_plan.hpp"

namespace stillmap {

/// In which type each layer works and each tensor is stored first.
struct LayerPrecision {
  /// What a convolution multiplies.
  std::vector<ValueType> of_layer;
  std::vector<ValueType> of_tensor;
};

/// f32 throughout without a calibration. With one, convolutions multiply s8 but for those that read
/// the network's input or make its output and `float_layers`; a tensor is s8 when a convolution
/// that multiplies s8 makes it and another one wants it so.
[[nodiscard]] LayerPrecision layer_precision(const NetworkGraph& graph,
                                             const Int8Calibration* calibration);

}  // namespace stillmap
