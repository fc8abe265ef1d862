#pragma once

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/int8_calibration.hpp"

namespace stillmap {

/// Makes the channels of each tensor about equally large, so that one factor for all of them, as
/// int8 has it, wastes no digits on small ones: what makes a channel is divided by its range, what
/// reads it multiplies by it. Convolutions, leaky ReLUs and sums let factors through, so the
/// network's output does not change. Tensors that are added share their factors; the network's
/// input and output, and what is added to them, keep theirs.
///
/// Gives the ranges that the channels have then. Tensors that the calibration does not know stay as
/// they are.
Int8Calibration equalise_channels(NetworkGraph& graph, const Int8Calibration& calibration);

}  // namespace stillmap
