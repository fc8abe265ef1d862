// An ONNX file, read for a small image up to the plan of its run, in floating point and in 8 bits.

#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn/execution_plan.hpp"
#include "core/segmentation/onednn/prepare_network.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/memory_folder.hpp"
#include "tests/segmentation/onnx_builder.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace onnx_inputs {
namespace {

constexpr int rows = 8, columns = 32, classes = 3;

ModelDescription describe(const std::filesystem::path& file) {
  ModelDescription model;
  model.name = "fuzzed";
  model.network_file = file;
  model.rows = rows;
  model.columns = columns;
  model.fov_up = 0.2;
  model.fov_down = -0.4;
  model.statistics.deviation.fill(1.0F);
  for (int i = 0; i < classes; ++i) model.classes.push_back(static_cast<SemanticClass>(i));
  return model;
}

/// Every channel of every tensor up to 1.
Int8Calibration calibrate(const NetworkGraph& graph) {
  Int8Calibration calibration;
  for (const Tensor& tensor : graph.tensors) {
    calibration.range_of_channels[tensor.name].assign(
        static_cast<std::size_t>(tensor.shape.channels), 1.0F);
  }
  return calibration;
}

void plan(const ModelDescription& model) {
  const OnnxFile file(model.network_file);
  require_input_shape(file, static_cast<int>(model.statistics.channels), model.rows, model.columns);
  PreparedNetwork network = prepare_network(file, model);
  static_cast<void>(plan_execution(network.graph, nullptr));
  const Int8Calibration equalised = equalise_channels(network.graph, calibrate(network.graph));
  static_cast<void>(plan_execution(network.graph, &equalised));
}

void run(Bytes bytes) {
  try {
    plan(describe(MemoryFolder::of_this_process().file("model.onnx", bytes)));
  } catch (const ModelError&) {
  } catch (const GraphFault&) {
  }
}

/// A layer of each kind, and a skip.
std::string every_layer(test::SoftmaxStyle softmax) {
  test::OnnxBuilder builder(static_cast<int>(plain_input_channels), rows, columns);
  const auto stem = builder.activate(builder.normalise(
      builder.convolve("input", 4, {.kernel = {3, 3}, .stride = {1, 2}, .padding = {1, 1}}, true)));
  const auto block = builder.activate(
      builder.convolve(stem, 4, {.kernel = {3, 3}, .stride = {1, 1}, .padding = {1, 1}}));
  const auto sum = builder.add(block, stem);
  const auto wide =
      builder.transpose(sum, 4, {.kernel = {1, 2}, .stride = {1, 2}, .padding = {0, 0}});
  return builder.bytes(builder.softmax(
      builder.convolve(wide, classes, {.kernel = {1, 1}, .stride = {1, 1}, .padding = {0, 0}}),
      softmax));
}

std::vector<Seed> seeds() {
  return {{"whole", every_layer(test::SoftmaxStyle::whole)},
          {"in_parts", every_layer(test::SoftmaxStyle::in_parts)},
          {"transposed", every_layer(test::SoftmaxStyle::between_transposes)}};
}

}  // namespace
}  // namespace onnx_inputs

const Target onnx_target{"onnx", onnx_inputs::run, onnx_inputs::seeds};

}  // namespace stillmap::fuzz
