#include "core/segmentation/graph/network_graph.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "core/segmentation/graph/graph_passes.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "tests/segmentation/reference_network.hpp"

namespace stillmap {
namespace {

using test::ReferenceTensor;
using test::run_reference;
using ::testing::HasSubstr;

constexpr ImageShape image{.channels = 3, .rows = 4, .columns = 6};

std::vector<float> random_values(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> any(-1.0F, 1.0F);
  std::vector<float> values(count);
  for (float& value : values) value = any(random);
  return values;
}

/// Builds graphs layer by layer; tensor 0 is the input.
struct GraphBuilder {
  NetworkGraph graph{.tensors = {{.name = "input"}}, .layers = {}};

  TensorId add(Operation operation, std::vector<TensorId> inputs) {
    const TensorId output = graph.tensors.size();
    graph.tensors.push_back({.name = "t" + std::to_string(output)});
    graph.layers.push_back({.name = "layer" + std::to_string(output),
                            .operation = std::move(operation),
                            .inputs = std::move(inputs),
                            .output = output});
    return graph.output = output;
  }
};

Convolution convolution(int inputs, int outputs, RowsColumns stride = {}) {
  const auto count = static_cast<std::size_t>(inputs * outputs * 9);
  return {.outputs = outputs,
          .inputs = inputs,
          .kernel = {.rows = 3, .columns = 3},
          .stride = stride,
          .dilation = {},
          .padding = {.top = 1, .left = 1, .bottom = 1, .right = 1},
          .weights = random_values(count, 5),
          .bias = random_values(static_cast<std::size_t>(outputs), 6),
          .upsampling = {}};
}

TransposedConvolution transposed(RowsColumns kernel, RowsColumns stride, Padding padding = {},
                                 RowsColumns extra = {.rows = 0, .columns = 0}) {
  constexpr int outputs = 2;
  const auto count =
      static_cast<std::size_t>(image.channels * outputs * kernel.rows * kernel.columns);
  return {.inputs = image.channels,
          .outputs = outputs,
          .kernel = kernel,
          .stride = stride,
          .padding = padding,
          .extra = extra,
          .weights = random_values(count, 7),
          .bias = random_values(outputs, 8)};
}

BatchNorm batch_norm(std::size_t channels) {
  return {.scale = random_values(channels, 9), .offset = random_values(channels, 10)};
}

ReferenceTensor run(const NetworkGraph& graph) {
  return run_reference(graph, image, random_values(image.size(), 1));
}

void expect_same(const ReferenceTensor& a, const ReferenceTensor& b) {
  EXPECT_EQ(a.shape, b.shape);
  ASSERT_EQ(a.values.size(), b.values.size());
  for (std::size_t i = 0; i < a.values.size(); ++i) EXPECT_NEAR(a.values[i], b.values[i], 1e-5);
}

TEST(FoldBatchNorms, LeavesTheResultOfConvolutionsAsItWas) {
  GraphBuilder builder;
  const TensorId narrow = builder.add(convolution(3, 5), {0});
  const TensorId normed = builder.add(batch_norm(5), {narrow});
  TransposedConvolution widening = transposed({.rows = 1, .columns = 4}, {.rows = 1, .columns = 2},
                                              {.top = 0, .left = 1, .bottom = 0, .right = 1});
  widening.inputs = 5;
  widening.weights = random_values(5 * 2 * 4, 3);
  builder.add(batch_norm(2), {builder.add(widening, {normed})});
  NetworkGraph folded = builder.graph;
  fold_batch_norms(folded);
  EXPECT_EQ(folded.layers.size(), 2U);
  expect_same(run(folded), run(builder.graph));
}

TEST(FoldBatchNorms, LeavesANormAloneWhoseInputIsReadElsewhere) {
  GraphBuilder builder;
  const TensorId c = builder.add(convolution(3, 5), {0});
  builder.add(Add{}, {builder.add(batch_norm(5), {c}), c});
  NetworkGraph folded = builder.graph;
  fold_batch_norms(folded);
  EXPECT_EQ(folded.layers.size(), 3U);
  expect_same(run(folded), run(builder.graph));
}

struct Widening {
  RowsColumns kernel, stride;
  Padding padding = {};
  RowsColumns extra = {.rows = 0, .columns = 0};
};

class ReplaceTransposed : public ::testing::TestWithParam<Widening> {};

TEST_P(ReplaceTransposed, GivesTheSame) {
  const Widening& w = GetParam();
  GraphBuilder builder;
  builder.add(transposed(w.kernel, w.stride, w.padding, w.extra), {0});
  NetworkGraph replaced = builder.graph;
  replace_transposed_convolutions(replaced);
  EXPECT_TRUE(std::holds_alternative<Convolution>(replaced.layers.front().operation));
  expect_same(run(replaced), run(builder.graph));
}

INSTANTIATE_TEST_SUITE_P(
    Widenings, ReplaceTransposed,
    ::testing::Values(
        // DarkNet's decoder.
        Widening{{1, 4}, {1, 2}, {0, 1, 0, 1}},
        // Kernel = stride.
        Widening{{1, 2}, {1, 2}}, Widening{{2, 2}, {2, 2}}, Widening{{2, 1}, {2, 1}},
        Widening{{3, 4}, {3, 4}},
        // A head that upsamples rows and columns.
        Widening{{2, 4}, {2, 2}, {0, 1, 0, 1}}, Widening{{4, 4}, {2, 2}, {1, 1, 1, 1}},
        // Odd kernels, unequal sides, places that no tap reaches.
        Widening{{3, 3}, {2, 2}, {1, 1, 0, 0}}, Widening{{3, 3}, {2, 2}, {1, 1, 1, 1}, {1, 1}},
        Widening{{3, 3}, {1, 1}, {1, 1, 1, 1}}, Widening{{1, 1}, {2, 2}, {0, 0, 0, 0}, {1, 1}}));

TEST(ReplaceTransposed, TurnsDarkNetsIntoOneByThreeOfTwiceTheOutputs) {
  GraphBuilder builder;
  builder.add(transposed({1, 4}, {1, 2}, {0, 1, 0, 1}), {0});
  replace_transposed_convolutions(builder.graph);
  const auto& c = std::get<Convolution>(builder.graph.layers.front().operation);
  EXPECT_EQ(c.kernel, (RowsColumns{.rows = 1, .columns = 3}));
  EXPECT_EQ(c.outputs, 4);
}

TEST(ReplaceTransposed, RefusesWhatIsNoMultipleOfTheInput) {
  GraphBuilder builder;
  builder.add(transposed({3, 3}, {2, 2}), {0});
  EXPECT_THROW(replace_transposed_convolutions(builder.graph), UnsupportedLayer);
}

TEST(FusePostOps, MakesADarkNetBlockTwoLayersWithTheSameResult) {
  GraphBuilder builder;
  const TensorId x = builder.add(LeakyRelu{0.1F}, {builder.add(convolution(3, 4), {0})});
  const TensorId narrow = builder.add(LeakyRelu{0.1F}, {builder.add(convolution(4, 2), {x})});
  const TensorId wide = builder.add(LeakyRelu{0.1F}, {builder.add(convolution(2, 4), {narrow})});
  builder.add(convolution(4, 3), {builder.add(Add{}, {wide, x})});
  NetworkGraph fused = builder.graph;
  fuse_post_ops(fused);
  EXPECT_EQ(fused.layers.size(), 4U);
  EXPECT_EQ(fused.layers[2].post_ops.size(), 2U);
  expect_same(run(fused), run(builder.graph));
}

TEST(FusePostOps, KeepsAResultWithOtherReaders) {
  GraphBuilder builder;
  const TensorId c = builder.add(convolution(3, 3), {0});
  builder.add(Add{}, {builder.add(LeakyRelu{0.2F}, {c}), c});
  NetworkGraph fused = builder.graph;
  fuse_post_ops(fused);
  EXPECT_EQ(fused.layers.size(), 3U);
  expect_same(run(fused), run(builder.graph));
}

TEST(FusePostOps, TakesASumIntoTheLaterOfItsLayers) {
  GraphBuilder builder;
  const TensorId first = builder.add(convolution(3, 4), {0});
  const TensorId second = builder.add(convolution(3, 4), {0});
  builder.add(LeakyRelu{0.3F}, {builder.add(Add{}, {first, second})});
  NetworkGraph fused = builder.graph;
  fuse_post_ops(fused);
  ASSERT_EQ(fused.layers.size(), 2U);
  EXPECT_TRUE(fused.layers[0].post_ops.empty());
  EXPECT_EQ(fused.layers[1].post_ops.size(), 2U);
  expect_same(run(fused), run(builder.graph));
}

TEST(FusePostOps, LeavesATensorThatIsAddedToItself) {
  GraphBuilder builder;
  const TensorId c = builder.add(convolution(3, 4), {0});
  builder.add(Add{}, {c, c});
  NetworkGraph fused = builder.graph;
  fuse_post_ops(fused);
  EXPECT_EQ(fused.layers.size(), 2U);
  expect_same(run(fused), run(builder.graph));
}

/// A network with a sum, whose operands share their factors, and with upsampling.
NetworkGraph tied() {
  GraphBuilder builder;
  const TensorId x = builder.add(LeakyRelu{0.1F}, {builder.add(convolution(3, 4), {0})});
  const TensorId y = builder.add(LeakyRelu{0.1F}, {builder.add(convolution(4, 4), {x})});
  const TensorId sum = builder.add(Add{}, {y, x});
  TransposedConvolution widening = transposed({1, 2}, {1, 2});
  widening.inputs = 4;
  widening.weights = random_values(4 * 2 * 2, 3);
  const TensorId wide = builder.add(LeakyRelu{0.1F}, {builder.add(widening, {sum})});
  builder.add(convolution(2, 3), {wide});
  replace_transposed_convolutions(builder.graph);
  fuse_post_ops(builder.graph);
  infer_shapes(builder.graph, image);
  return builder.graph;
}

TEST(EqualiseChannels, MakesRangesEqualAndLeavesTheResult) {
  const NetworkGraph before = tied();
  Int8Calibration calibration;
  float range = 0.5F;
  for (const Tensor& tensor : before.tensors) {
    auto& ranges = calibration.range_of_channels[tensor.name];
    for (int c = 0; c < tensor.shape.channels; ++c) ranges.push_back(range *= 1.4F);
  }
  NetworkGraph graph = before;
  const Int8Calibration equalised = equalise_channels(graph, calibration);
  const ReferenceTensor expected = run(before);
  const ReferenceTensor result = run(graph);
  for (std::size_t i = 0; i < expected.values.size(); ++i) {
    EXPECT_NEAR(result.values[i], expected.values[i], 1e-4 * (1.0 + std::abs(expected.values[i])));
  }
  const std::string last_sum = graph.tensors[graph.layers[1].output].name;
  for (const float equal : equalised.range_of_channels.at(last_sum)) {
    EXPECT_NEAR(equal, equalised.range_of_channels.at(last_sum).front(), 1e-3F);
  }
  // The input and the output keep their channels.
  for (const TensorId end : {graph.input, graph.output}) {
    const std::string& name = graph.tensors[end].name;
    EXPECT_EQ(equalised.range_of_channels.at(name), calibration.range_of_channels.at(name));
  }
}

TEST(EqualiseChannels, LeavesChannelsThatAreAlwaysZero) {
  NetworkGraph graph = tied();
  Int8Calibration calibration;
  for (const Tensor& tensor : graph.tensors) {
    calibration.range_of_channels[tensor.name].assign(
        static_cast<std::size_t>(tensor.shape.channels), 0.0F);
  }
  const ReferenceTensor before = run(graph);
  (void)equalise_channels(graph, calibration);
  expect_same(run(graph), before);
}

TEST(DropFinalSoftmax, TakesOffOnlyOneThatMakesTheOutput) {
  GraphBuilder builder;
  const TensorId scores = builder.add(convolution(3, 4), {0});
  builder.add(Softmax{}, {scores});
  EXPECT_TRUE(drop_final_softmax(builder.graph));
  EXPECT_EQ(builder.graph.output, scores);
  EXPECT_FALSE(drop_final_softmax(builder.graph));
}

TEST(NetworkStride, IsWhatTheImageIsNarrowedByAtMost) {
  GraphBuilder builder;
  TensorId x = builder.add(convolution(3, 3, {.rows = 1, .columns = 2}), {0});
  x = builder.add(convolution(3, 3, {.rows = 2, .columns = 2}), {x});
  x = builder.add(transposed({2, 2}, {2, 2}), {x});
  EXPECT_EQ(network_stride(builder.graph), (RowsColumns{.rows = 2, .columns = 4}));
}

std::string shape_fault(NetworkGraph graph, const ImageShape& shape) {
  try {
    infer_shapes(graph, shape);
    return {};
  } catch (const GraphFault& fault) {
    return fault.what();
  }
}

TEST(InferShapes, SaysWhereLayersDoNotFit) {
  GraphBuilder builder;
  const TensorId narrow = builder.add(convolution(3, 3, {.rows = 2, .columns = 2}), {0});
  EXPECT_EQ(shape_fault(builder.graph, image), "");
  EXPECT_THAT(shape_fault(builder.graph, {.channels = 5, .rows = 4, .columns = 6}),
              HasSubstr("weights for 3 channels, but its input is 5x4x6"));
  builder.add(Add{}, {0, narrow});
  EXPECT_THAT(shape_fault(builder.graph, image),
              HasSubstr("cannot add tensors of 3x4x6 and 3x2x3"));
}

TEST(InferShapes, RefusesTensorsThatAreEmptyOrAbsurd) {
  GraphBuilder builder;
  Convolution large = convolution(3, 3);
  large.padding = {};
  builder.add(large, {0});
  EXPECT_THAT(shape_fault(builder.graph, {.channels = 3, .rows = 2, .columns = 6}),
              HasSubstr("leaves nothing"));
  EXPECT_THAT(shape_fault(builder.graph, {.channels = 3, .rows = 1 << 20, .columns = 1 << 20}),
              HasSubstr("absurd"));
}

}  // namespace
}  // namespace stillmap
