#pragma once

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {

/// Takes the activations and up to two sums that come after a convolution, and that alone read its
/// result, into the convolution (Layer::post_ops): what is between is never stored. A second sum
/// is the last that it takes, and where it widens rows the first one.
///
/// A sum goes to the later of the two layers that it adds.
void fuse_post_ops(NetworkGraph& graph);

/// Removes a soft-max that makes the output, which is scores then; false when there was none.
bool drop_final_softmax(NetworkGraph& graph);

}  // namespace stillmap
