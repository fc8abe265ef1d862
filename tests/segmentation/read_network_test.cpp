#include "core/segmentation/onnx/read_network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/reference_network.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using test::OnnxBuilder;
using test::SoftmaxStyle;
using test::Window;
using test::write_model;
using ::testing::HasSubstr;

NetworkGraph read(const std::string& bytes) { return read_network(OnnxFile(write_model(bytes))); }

/// The message of UnsupportedLayer; empty when the network is read.
std::string unsupported(const std::string& bytes) {
  const OnnxFile file(write_model(bytes));
  try {
    (void)read_network(file);
    return {};
  } catch (const UnsupportedLayer& fault) {
    return fault.what();
  }
}

const Window three{.kernel = {3, 3}, .padding = {1, 1}};

TEST(ReadNetwork, RecognisesTheSoftmaxInEveryFormOfExporters) {
  for (const SoftmaxStyle style :
       {SoftmaxStyle::whole, SoftmaxStyle::in_parts, SoftmaxStyle::between_transposes}) {
    OnnxBuilder network(5, 4, 8);
    const NetworkGraph graph =
        read(network.bytes(network.softmax(network.convolve("input", 3, three), style)));
    ASSERT_EQ(graph.layers.size(), 2U);
    EXPECT_TRUE(std::holds_alternative<Softmax>(graph.layers.back().operation));
    EXPECT_EQ(graph.layers.back().output, graph.output);
  }
}

TEST(ReadNetwork, TakesAConvolutionAsItIsWritten) {
  OnnxBuilder network(5, 4, 8);
  const NetworkGraph graph = read(network.bytes(
      network.convolve("input", 3, {.kernel = {3, 5}, .stride = {2, 1}, .padding = {1, 2}}, true)));
  const auto& c = std::get<Convolution>(graph.layers.front().operation);
  EXPECT_EQ(c.outputs, 3);
  EXPECT_EQ(c.inputs, 5);
  EXPECT_EQ(c.kernel, (RowsColumns{.rows = 3, .columns = 5}));
  EXPECT_EQ(c.stride, (RowsColumns{.rows = 2, .columns = 1}));
  EXPECT_EQ(c.padding, (Padding{.top = 1, .left = 2, .bottom = 1, .right = 2}));
  EXPECT_EQ(c.weights.size(), 3U * 5U * 15U);
  EXPECT_NE(c.bias.front(), 0.0F);
}

TEST(ReadNetwork, LooksThroughIdentityAndDropout) {
  OnnxBuilder network(5, 4, 8);
  const std::string x = network.convolve("input", 3, three);
  const std::string same = network.node("Identity", {network.node("Dropout", {x}, 3)}, 3);
  const std::vector<float> one_by_one(9, 0.5F);
  const std::string weights =
      network.weights(test::float_tensor("w", {3, 3, 1, 1}, one_by_one), "w");
  const std::string renamed = network.node("Identity", {weights}, 3);
  const NetworkGraph graph = read(network.bytes(network.node("Conv", {same, renamed}, 3)));
  ASSERT_EQ(graph.layers.size(), 2U);
  EXPECT_EQ(graph.layers[1].inputs.front(), graph.layers[0].output);
  EXPECT_EQ(std::get<Convolution>(graph.layers[1].operation).weights, one_by_one);
}

TEST(ReadNetwork, NamesWhatItDoesNotSupport) {
  const auto with_node = [](const std::string& kind, const std::vector<test::Message>& attributes) {
    OnnxBuilder network(5, 4, 8);
    return unsupported(network.bytes(network.node(kind, {"input"}, 5, attributes)));
  };
  EXPECT_THAT(with_node("HardSwish", {}), HasSubstr("operator HardSwish (layer 'make_t1')"));
  // Over rows instead of channels.
  EXPECT_THAT(with_node("Softmax", {test::int_attribute("axis", 2)}), HasSubstr("Softmax"));
  EXPECT_THAT(with_node("ReduceSum", {}), HasSubstr("ReduceSum"));
  EXPECT_THAT(with_node("Exp", {}), HasSubstr("not supported"));
  EXPECT_THAT(with_node("Transpose", {test::ints_attribute("perm", {1, 0, 2, 3})}),
              HasSubstr("Transpose"));
}

TEST(ReadNetwork, RefusesConvolutionsOfAnotherKind) {
  const auto convolve = [](const std::vector<test::Message>& attributes) {
    OnnxBuilder network(5, 4, 8);
    network.weights(test::float_tensor("w", {3, 5, 1, 1}, std::vector<float>(15, 1.0F)), "w");
    const std::string bytes = network.bytes(network.node("Conv", {"input", "w"}, 3, attributes));
    const OnnxFile file(write_model(bytes));
    try {
      (void)read_network(file);
      return std::string();
    } catch (const GraphFault& fault) {
      return std::string(fault.what());
    }
  };
  using test::ints_attribute;
  EXPECT_EQ(convolve({}), "");
  EXPECT_THAT(convolve({test::int_attribute("group", 5)}), HasSubstr("5 groups"));
  EXPECT_THAT(convolve({test::string_attribute("auto_pad", "SAME_UPPER")}), HasSubstr("auto_pad"));
  EXPECT_THAT(convolve({ints_attribute("pads", {0, -1, 0, 0})}), HasSubstr("pads is -1"));
  EXPECT_THAT(convolve({ints_attribute("strides", {0, 1})}), HasSubstr("strides is 0"));
  EXPECT_THAT(convolve({ints_attribute("strides", {std::int64_t{1} << 40, 1})}),
              HasSubstr("strides is 1099511627776"));
  EXPECT_THAT(convolve({ints_attribute("strides", {1, 1, 1})}), HasSubstr("has 3 numbers"));
  EXPECT_THAT(convolve({ints_attribute("kernel_shape", {3, 3})}), HasSubstr("kernel_shape"));
}

TEST(ReadNetwork, RefusesWeightsThatAreWorkedOut) {
  OnnxBuilder network(5, 4, 8);
  const std::string x = network.convolve("input", 5, three);
  EXPECT_THAT(unsupported(network.bytes(network.node("Conv", {"input", x}, 3))),
              HasSubstr("worked out by the network"));
}

TEST(OnnxFile, ReadsTheDeclaredShapeAndWhatIsLeftOpen) {
  using Shape = std::vector<std::int64_t>;
  OnnxBuilder fixed(5, 8, 300);
  const OnnxFile file(write_model(fixed.bytes(fixed.convolve("input", 3, three))));
  EXPECT_EQ(file.declared_input_shape(), (Shape{1, 5, 8, 300}));
  OnnxBuilder open(5, 0, 0);
  const OnnxFile other(write_model(open.bytes(open.convolve("input", 3, three))));
  EXPECT_EQ(other.declared_input_shape(), (Shape{1, 5, 0, 0}));
}

}  // namespace
}  // namespace stillmap
