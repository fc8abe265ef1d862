#include "core/segmentation/onednn/prepare_network.hpp"

#include "core/segmentation/graph/graph_passes.hpp"
#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/onnx/read_network.hpp"

namespace stillmap {
namespace {

void require_multiple(const char* what, int size, int stride) {
  if (size % stride == 0) return;
  throw GraphFault(std::string(what) + " of its image must be a multiple of " +
                   std::to_string(stride) + ", the network's stride, but its description has " +
                   std::to_string(size));
}

void require_output(const NetworkGraph& graph, const ModelDescription& model) {
  const ImageShape wanted{.channels = static_cast<int>(model.classes.size()),
                          .rows = model.rows,
                          .columns = model.columns};
  const ImageShape& given = graph.tensors[graph.output].shape;
  if (given == wanted) return;
  throw GraphFault("gives an output of 1x" + given.text() + ", but 1x" + wanted.text() +
                   " is wanted (1 x classes x rows x columns of its description)");
}

/// Multiplications and additions of all convolutions, in 10^9.
double count_operations(const NetworkGraph& graph) {
  const auto pixels = [&graph](TensorId tensor) {
    const ImageShape& shape = graph.tensors[tensor].shape;
    return static_cast<double>(shape.rows) * shape.columns;
  };
  double products = 0.0;
  for (const Layer& layer : graph.layers) {
    if (const auto* const c = std::get_if<Convolution>(&layer.operation)) {
      products += pixels(layer.output) * static_cast<double>(c->weights.size());
    } else if (const auto* const t = std::get_if<TransposedConvolution>(&layer.operation)) {
      products += pixels(layer.inputs.front()) * static_cast<double>(t->weights.size());
    }
  }
  return 2.0 * products / 1e9;
}

}  // namespace

PreparedNetwork prepare_network(const OnnxFile& file, const ModelDescription& model) {
  PreparedNetwork network{.graph = read_network(file)};
  NetworkGraph& graph = network.graph;
  for (const Layer& layer : graph.layers) network.file_layers.push_back(layer.name);
  const RowsColumns stride = network_stride(graph);
  require_multiple("rows", model.rows, stride.rows);
  require_multiple("columns", model.columns, stride.columns);
  infer_shapes(graph, {.channels = static_cast<int>(model.statistics.channels),
                       .rows = model.rows,
                       .columns = model.columns});
  require_output(graph, model);
  network.giga_operations = count_operations(graph);
  network.had_softmax = drop_final_softmax(graph);
  fold_batch_norms(graph);
  replace_transposed_convolutions(graph);
  fuse_post_ops(graph);
  return network;
}

}  // namespace stillmap
