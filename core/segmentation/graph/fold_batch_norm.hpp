#pragma once

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {

/// Works batch norms into the weights of the convolutions, plain and transposed, that they alone
/// follow: w' = scale w, b' = scale b + offset. Others stay.
void fold_batch_norms(NetworkGraph& graph);

}  // namespace stillmap
