#include "core/segmentation/onednn/execution_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "core/segmentation/onednn/prepare_network.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

NetworkGraph prepared(const std::string& bytes, int rows, int columns) {
  ModelDescription model = test::describe_family(rows, columns, 4);
  model.network_file = test::write_model(bytes);
  return prepare_network(OnnxFile(model.network_file), model).graph;
}

NetworkGraph darknet() { return prepared(test::darknet_bytes(21, 4, 2, 64, 4), 2, 64); }
NetworkGraph light() { return prepared(test::light_bytes(4, 8, 32, 4), 8, 32); }

Int8Calibration calibration_of(const NetworkGraph& graph) {
  Int8Calibration calibration;
  for (std::size_t i = 0; i < graph.tensors.size(); ++i) {
    calibration.range_of_channels[graph.tensors[i].name] = {1.0F + static_cast<float>(i)};
  }
  return calibration;
}

/// Simulates the plan: each step must find in its source buffers the tensors that it reads.
void expect_right_contents(const ExecutionPlan& plan) {
  std::vector<std::pair<TensorId, ValueType>> holds(plan.buffers.size(), {999999, ValueType::f32});
  const auto expect = [&](const TensorPlacement& place) {
    EXPECT_EQ(holds[place.buffer], std::pair(place.tensor, place.type));
  };
  for (std::size_t i = 0; i < plan.steps.size(); ++i) {
    std::visit(
        [&](const auto& step) {
          if constexpr (requires { step.from; }) expect(step.from);
          if constexpr (requires { step.first; }) expect(step.first);
          if constexpr (requires { step.second; }) expect(step.second);
          if constexpr (requires { step.added; }) {
            if (step.added) expect(*step.added);
          }
        },
        plan.steps[i]);
    const TensorPlacement& to = target(plan.steps[i]);
    EXPECT_LE(plan.buffers[to.buffer].first_step, i);
    EXPECT_GE(plan.buffers[to.buffer].last_step, i);
    holds[to.buffer] = {to.tensor, to.type};
  }
  expect(plan.output);
}

std::size_t count_convolutions(const NetworkGraph& graph) {
  return static_cast<std::size_t>(std::ranges::count_if(graph.layers, [](const Layer& layer) {
    return std::holds_alternative<Convolution>(layer.operation);
  }));
}

template <class Kind>
std::size_t count_steps(const ExecutionPlan& plan) {
  return static_cast<std::size_t>(std::ranges::count_if(
      plan.steps, [](const Step& step) { return std::holds_alternative<Kind>(step); }));
}

TEST(ExecutionPlan, ReducesTheFamilyToConvolutions) {
  for (const NetworkGraph& graph : {darknet(), light()}) {
    EXPECT_EQ(count_convolutions(graph), graph.layers.size());
    const ExecutionPlan plan = plan_execution(graph, nullptr);
    EXPECT_EQ(count_steps<Convolve>(plan), graph.layers.size());
    EXPECT_EQ(count_steps<Convert>(plan) + count_steps<Activate>(plan), 0U);
    const Int8Calibration calibration = calibration_of(graph);
    EXPECT_EQ(count_steps<Sum>(plan_execution(graph, &calibration)), 0U);
  }
  EXPECT_EQ(count_steps<Sum>(plan_execution(light(), nullptr)), 0U);
}

TEST(ExecutionPlan, NeverReadsAnOverwrittenBuffer) {
  for (const NetworkGraph& graph : {darknet(), light()}) {
    const Int8Calibration calibration = calibration_of(graph);
    for (const FloatSummand float_summand : {FloatSummand::in_place, FloatSummand::apart}) {
      expect_right_contents(plan_execution(graph, nullptr, float_summand));
      expect_right_contents(plan_execution(graph, &calibration, float_summand));
    }
  }
}

TEST(ExecutionPlan, AddsApartWhereTheProcessorCannotAddInPlace) {
  const NetworkGraph graph = darknet();
  std::size_t summands = 0;
  for (const Step& step : plan_execution(graph, nullptr, FloatSummand::apart).steps) {
    const auto* const convolve = std::get_if<Convolve>(&step);
    if (convolve == nullptr || !convolve->added) continue;
    EXPECT_FALSE(convolve->sum_scale);
    EXPECT_NE(convolve->added->buffer, convolve->to.buffer);
    ++summands;
  }
  EXPECT_GT(summands, 0U);
}

TEST(ExecutionPlan, KeepsTheFirstAndTheLastLayerInFloatingPoint) {
  const NetworkGraph graph = light();
  Int8Calibration calibration = calibration_of(graph);
  LayerPrecision precision = layer_precision(graph, &calibration);
  EXPECT_EQ(precision.of_layer.front(), ValueType::f32);
  EXPECT_EQ(precision.of_layer.back(), ValueType::f32);
  EXPECT_EQ(std::ranges::count(precision.of_layer, ValueType::f32), 2);
  calibration.float_layers = {graph.layers[3].name};
  precision = layer_precision(graph, &calibration);
  EXPECT_EQ(precision.of_layer[3], ValueType::f32);
}

TEST(ExecutionPlan, RefusesAnotherNetworksCalibration) {
  const NetworkGraph graph = light();
  const Int8Calibration other{
      .made = "", .range_of_channels = {{"someone", {1.0F}}}, .float_layers = {}};
  EXPECT_THROW((void)plan_execution(graph, &other), GraphFault);
}

TEST(ExecutionPlan, AddsToACopyOfATensorThatIsReadAgain) {
  // x feeds a convolution that is added to x, and the output as well.
  test::OnnxBuilder network(5, 4, 8);
  const test::Window same{.kernel = {3, 3}, .padding = {1, 1}};
  const std::string x = network.convolve("input", 4, same);
  const std::string y = network.add(network.convolve(x, 4, same), x);
  const std::string z = network.add(network.convolve(y, 4, same), x);
  const NetworkGraph graph = prepared(network.bytes(network.convolve(z, 4, same)), 4, 8);
  const ExecutionPlan plan = plan_execution(graph, nullptr);
  expect_right_contents(plan);
  EXPECT_GE(count_steps<Convert>(plan), 1U);
  for (const Step& step : plan.steps) {
    const auto* const convolve = std::get_if<Convolve>(&step);
    if (convolve == nullptr) continue;
    EXPECT_NE(convolve->from.buffer, convolve->to.buffer);
  }
}

TEST(BufferLayout, SeparatesBuffersWithOverlappingLifetimes) {
  std::mt19937 random(5);
  for (int run = 0; run < 50; ++run) {
    std::vector<Buffer> buffers(30);
    std::size_t sum = 0, largest = 0;
    for (Buffer& buffer : buffers) {
      buffer.bytes = random() % 1000 + 1;
      buffer.first_step = random() % 40;
      buffer.last_step = buffer.first_step + random() % 10;
      sum += buffer.bytes + BufferLayout::alignment;
      largest = std::max(largest, buffer.bytes);
    }
    const BufferLayout layout = lay_out(buffers);
    EXPECT_GE(layout.bytes, largest);
    EXPECT_LT(layout.bytes, sum);
    for (std::size_t a = 0; a < buffers.size(); ++a) {
      EXPECT_EQ(layout.offset[a] % BufferLayout::alignment, 0U);
      EXPECT_LE(layout.offset[a] + buffers[a].bytes, layout.bytes);
      for (std::size_t b = 0; b < a; ++b) {
        const bool together = buffers[a].first_step <= buffers[b].last_step &&
                              buffers[b].first_step <= buffers[a].last_step;
        const bool apart = layout.offset[a] + buffers[a].bytes <= layout.offset[b] ||
                           layout.offset[b] + buffers[b].bytes <= layout.offset[a];
        EXPECT_TRUE(!together || apart);
      }
    }
  }
}

TEST(BufferLayout, ReusesMemory) {
  const std::vector<Buffer> chain{{.bytes = 640, .first_step = 0, .last_step = 1},
                                  {.bytes = 640, .first_step = 1, .last_step = 2},
                                  {.bytes = 640, .first_step = 2, .last_step = 3},
                                  {.bytes = 640, .first_step = 3, .last_step = 4}};
  EXPECT_EQ(lay_out(chain).bytes, 1280U);
}

}  // namespace
}  // namespace stillmap
