#include "core/segmentation/bare_model.hpp"

#include "core/segmentation/graph/infer_shapes.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onnx/onnx_file.hpp"
#include "core/segmentation/onnx/read_network.hpp"

namespace stillmap {
namespace {

std::size_t count_outputs(const OnnxFile& file, const ModelDescription& model) {
  try {
    NetworkGraph graph = read_network(file);
    infer_shapes(graph, {.channels = static_cast<int>(input_channels),
                         .rows = model.rows,
                         .columns = model.columns});
    return static_cast<std::size_t>(graph.tensors[graph.output].shape.channels);
  } catch (const GraphFault& fault) {
    throw ModelError(file.file(), fault.what());
  }
}

}  // namespace

ModelDescription describe_bare_network(const std::filesystem::path& network_file, int rows,
                                       int columns) {
  const OnnxFile file(network_file);
  ModelDescription model;
  model.name = network_file.filename().string();
  model.network_file = network_file;
  const std::vector<std::int64_t> declared = file.declared_input_shape();
  const bool declares_size = declared.size() == 4 && declared[2] > 0 && declared[3] > 0;
  model.rows = declares_size ? static_cast<int>(declared[2]) : rows;
  model.columns = declares_size ? static_cast<int>(declared[3]) : columns;
  const SensorModel sensor = hdl_64e();
  model.fov_up = sensor.fov_up;
  model.fov_down = sensor.fov_down;
  model.statistics.deviation.fill(1.0F);
  model.classes.assign(count_outputs(file, model), SemanticClass::unlabeled);
  model.knn = KnnConfig{};
  return model;
}

}  // namespace stillmap
