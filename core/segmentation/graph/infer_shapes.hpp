#pragma once

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {

/// The network's strides: rows and columns of its image must be multiples of them, so that what
/// was narrowed fits again when it is widened.
[[nodiscard]] RowsColumns network_stride(const NetworkGraph& graph);

/// Works out the shape of every tensor for an input of this shape. Throws GraphFault where layers
/// do not fit together or a tensor would be absurdly large.
void infer_shapes(NetworkGraph& graph, const ImageShape& input);

}  // namespace stillmap
