#pragma once

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {

/// Works batch norms into the weights of the convolutions, plain and transposed, that they alone
/// follow: w' = scale w, b' = scale b + offset. Others stay.
void fold_batch_norms(NetworkGraph& graph);

/// Puts ordinary convolutions in place of transposed ones: each phase of the stride sees its own
/// taps of the kernel, so that all phases together are the outputs of one convolution, laid out
/// side by side (Convolution::widen). A kernel of 1x4 over a stride of 1x2 becomes 1x3 with twice
/// the outputs; a kernel as large as its stride becomes 1x1.
///
/// Throws UnsupportedLayer where the output is not stride times the input.
void replace_transposed_convolutions(NetworkGraph& graph);

/// Takes the activations and up to two sums that come after a convolution, and that alone read its
/// result, into the convolution (Layer::post_ops): what is between is never stored. A second sum
/// is the last that it takes, and where it widens rows the first one.
///
/// A sum goes to the later of the two layers that it adds.
void fuse_post_ops(NetworkGraph& graph);

/// Removes a soft-max that makes the output, which is scores then; false when there was none.
bool drop_final_softmax(NetworkGraph& graph);

}  // namespace stillmap
