#include "core/segmentation/open_network.hpp"

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/onnx/onnx_file.hpp"
#include "core/segmentation/onnx/read_network.hpp"
#include "core/segmentation/opencv_network.hpp"

namespace stillmap {
namespace {

using Engine = EngineOptions::Engine;
using PrecisionMode = EngineOptions::PrecisionMode;

Precision precision_of(const ModelDescription& model, PrecisionMode wanted) {
  if (wanted == PrecisionMode::automatic) return model.int8 ? Precision::int8 : Precision::fp32;
  return wanted == PrecisionMode::int8 ? Precision::int8 : Precision::fp32;
}

/// What could be better about the precision; else empty.
std::string remark_on_precision(const ModelDescription& model, const EngineOptions& choice,
                                Precision precision) {
  if (choice.precision == PrecisionMode::automatic && !model.int8)
    return "int8 would be faster, but the model is not calibrated for it: 'stillmap model "
           "calibrate' does it";
  if (precision == Precision::int8 && model.int8->network_crc32.empty())
    return "int8.yaml does not say with which model.onnx it was made: 'stillmap model calibrate' "
           "makes one that does";
  return {};
}

OpenedNetwork open_with_onednn(const ModelDescription& model, const EngineOptions& choice) {
  const Precision precision = precision_of(model, choice.precision);
  auto network = std::make_unique<OneDnnNetwork>(model, precision, choice.threads);
  const int threads = network->threads();
  return {.network = std::move(network),
          .threads = threads,
          .remark = remark_on_precision(model, choice, precision)};
}

OpenedNetwork open_with_opencv(const ModelDescription& model, const EngineOptions& choice,
                               std::string remark) {
  if (choice.precision == PrecisionMode::int8) {
    throw ModelError(model.network_file,
                     "cannot run in int8 on OpenCV; use precision: auto or fp32");
  }
  return {
      .network = std::make_unique<OpenCvNetwork>(model), .threads = 1, .remark = std::move(remark)};
}

}  // namespace

OpenedNetwork open_network(const ModelDescription& model, const EngineOptions& choice) {
  if (choice.engine == Engine::opencv) return open_with_opencv(model, choice, "");
  if (choice.engine == Engine::onednn || choice.precision == PrecisionMode::int8) {
    return open_with_onednn(model, choice);
  }
  try {
    return open_with_onednn(model, choice);
  } catch (const UnsupportedModel& error) {
    return open_with_opencv(model, choice,
                            std::string("OpenCV runs it, several times slower: ") + error.what());
  }
}

namespace {

std::size_t count_outputs(const OnnxFile& file, const ModelDescription& model) {
  try {
    NetworkGraph graph = read_network(file);
    infer_shapes(graph, {.channels = static_cast<int>(model.statistics.channels),
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
