#include "core/segmentation/opencv_network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "core/segmentation/model_error.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using test::describe;
using test::onnx_bytes;
using test::random_network;
using test::TinyNetwork;
using test::write_model;
using ::testing::HasSubstr;

/// The engine's error message; empty when it accepts the model.
std::string refusal(const ModelDescription& model) {
  try {
    const OpenCvNetwork network(model);
    return {};
  } catch (const ModelError& error) {
    EXPECT_THAT(error.what(), HasSubstr(model.network_file.string()));
    return error.what();
  }
}

std::string refusal(const TinyNetwork& network) {
  ModelDescription model = describe(network);
  model.network_file = write_model(onnx_bytes(network));
  return refusal(model);
}

TEST(OpenCvNetwork, TakesASoundModel) { EXPECT_EQ(refusal(random_network(8, 32, 20)), ""); }

TEST(OpenCvNetwork, GivesTheSameWithAndWithoutSoftMaxInTheModel) {
  TinyNetwork tiny = random_network(8, 32, 20);
  ModelDescription model = describe(tiny);
  std::vector<float> input(5 * 8 * 32);
  for (std::size_t i = 0; i < input.size(); ++i) input[i] = static_cast<float>(i % 17) / 8.0F;
  model.network_file = write_model(onnx_bytes(tiny));
  const PixelOutputs with = OpenCvNetwork(model).run(input);
  tiny.softmax = false;
  model.network_file = write_model(onnx_bytes(tiny));
  const PixelOutputs without = OpenCvNetwork(model).run(input);
  EXPECT_EQ(with.output, without.output);
  EXPECT_THAT(with.confidence,
              ::testing::Pointwise(::testing::FloatNear(1e-5F), without.confidence));
}

TEST(OpenCvNetwork, RefusesAnImageOfAnotherSize) {
  TinyNetwork tiny = random_network(8, 32, 3);
  ModelDescription model = describe(tiny);
  model.network_file = write_model(onnx_bytes(tiny));
  model.columns = 64;
  EXPECT_THAT(refusal(model),
              HasSubstr("wants an input of 1x5x8x32, but its description has 1x5x8x64"));
}

TEST(OpenCvNetwork, RefusesWeightsThatDoNotFitTheInput) {
  TinyNetwork tiny = random_network(8, 32, 4);
  // The input is declared with 5 channels, the weights are for 3.
  tiny.weight_channels = 3;
  tiny.weights.resize(4 * 3);
  EXPECT_THAT(refusal(tiny), HasSubstr("Number of input channels should be multiple of 3"));
}

TEST(OpenCvNetwork, RefusesWeightsThatAreNotFinite) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    TinyNetwork tiny = random_network(8, 32, 3);
    tiny.weights[7] = bad;
    EXPECT_THAT(refusal(tiny), HasSubstr("not all finite"));
    tiny = random_network(8, 32, 3);
    tiny.bias[1] = bad;
    EXPECT_THAT(refusal(tiny), HasSubstr("finite"));
  }
}

TEST(OpenCvNetwork, NamesAnUnknownOperator) {
  TinyNetwork tiny = random_network(8, 32, 3);
  tiny.operation = "Convolve";
  EXPECT_THAT(refusal(tiny), HasSubstr("Convolve"));
}

TEST(OpenCvNetwork, RefusesADescriptionWithFaults) {
  ModelDescription model = describe(random_network(8, 32, 3));
  model.network_file = write_model(onnx_bytes(random_network(8, 32, 3)));
  model.statistics.deviation[3] = 0.0F;
  model.rows = 0;
  model.classes.clear();
  const std::string text = refusal(model);
  EXPECT_THAT(text, HasSubstr("deviation of z"));
  EXPECT_THAT(text, HasSubstr("rows is 0"));
  EXPECT_THAT(text, HasSubstr("classes"));
}

}  // namespace
}  // namespace stillmap
