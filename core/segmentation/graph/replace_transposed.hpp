#pragma once

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {

/// Puts ordinary convolutions in place of transposed ones: each phase of the stride sees its own
/// taps of the kernel, so that all phases together are the outputs of one convolution, laid out
/// side by side (Convolution::widen). A kernel of 1x4 over a stride of 1x2 becomes 1x3 with twice
/// the outputs; a kernel as large as its stride becomes 1x1.
///
/// Throws UnsupportedLayer where the output is not stride times the input.
void replace_transposed_convolutions(NetworkGraph& graph);

}  // namespace stillmap
