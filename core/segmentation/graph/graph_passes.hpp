#pragma once

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {

// Passes that simplify a network for inference. None changes its output, except that
// drop_final_softmax() leaves logits.

/// Folds each batch norm into the convolution, plain or transposed, whose only reader it is:
/// w' = scale w, b' = scale b + offset. Other batch norms stay.
void fold_batch_norms(NetworkGraph& graph);

/// Replaces transposed convolutions by convolutions with depth-to-space (Convolution::upsampling):
/// each phase of the stride uses its own taps of the kernel, and all phases together are the
/// outputs of one convolution. A 1x4 kernel of stride 1x2 becomes 1x3 with twice the outputs; a
/// kernel as large as its stride becomes 1x1.
///
/// Throws UnsupportedLayer where the output's size is not stride times the input's.
void replace_transposed_convolutions(NetworkGraph& graph);

/// Moves the activations and up to two sums that follow a convolution, as the only readers of its
/// result, into the convolution (Layer::post_ops), so that intermediate results are not stored.
/// Fusing ends after the second sum, with upsampling of rows after the first. A sum is fused into
/// the later of the two layers whose results it adds.
void fuse_post_ops(NetworkGraph& graph);

/// Removes a soft-max at the end, so that the output is logits; false when there is none.
bool drop_final_softmax(NetworkGraph& graph);

}  // namespace stillmap
