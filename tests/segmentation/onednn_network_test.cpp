#include "core/segmentation/onednn_network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>

#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onnx/read_network.hpp"
#include "core/segmentation/opencv_network.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/reference_network.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using test::OnnxBuilder;
using test::random_image;
using test::Window;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr int classes = 20;

ModelDescription written(const std::string& bytes, int rows, int columns, int outputs = classes) {
  ModelDescription model = test::describe_family(rows, columns, outputs);
  model.network_file = test::write_model(bytes);
  return model;
}

template <class A, class B>
double largest_difference(const A& a, const B& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i]));
    // A comparison with NaN would be false.
    if (!std::isfinite(difference)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, difference);
  }
  return largest;
}

std::vector<double> plain_probabilities(const ModelDescription& model,
                                        const std::vector<float>& image) {
  return test::run_reference(read_network(OnnxFile(model.network_file)),
                             {.channels = 5, .rows = model.rows, .columns = model.columns}, image)
      .values;
}

void expect_parity(const ModelDescription& model) {
  OneDnnNetwork network(model, Precision::fp32);
  OpenCvNetwork reference(model);
  for (unsigned seed = 1; seed < 4; ++seed) {
    const std::vector<float> image = random_image(model, seed);
    const std::vector<float> probabilities = network.probabilities(image);
    EXPECT_LT(largest_difference(probabilities, reference.probabilities(image)), 1e-4);
    EXPECT_LT(largest_difference(probabilities, plain_probabilities(model, image)), 1e-4);
    EXPECT_EQ(network.run(image).output, reference.run(image).output);
  }
}

TEST(OneDnnNetwork, AgreesWithOpenCvAndPlainArithmeticOnDarkNet21) {
  expect_parity(written(test::darknet_bytes(21, 8, 4, 64, classes), 4, 64));
}

TEST(OneDnnNetwork, AgreesWithOpenCvAndPlainArithmeticOnDarkNet53) {
  expect_parity(written(test::darknet_bytes(53, 4, 2, 64, classes), 2, 64));
}

TEST(OneDnnNetwork, AgreesWithOpenCvAndPlainArithmeticOnLightMembers) {
  expect_parity(written(test::light_bytes(8, 8, 32, classes), 8, 32));
  // Other channels than a vector holds, sizes left open in the file, a sensor of few rings.
  expect_parity(written(test::light_bytes(5, 0, 0, classes), 4, 16));
}

TEST(OneDnnNetwork, GivesTheSameWithAnyNumberOfThreads) {
  const ModelDescription model = written(test::light_bytes(8, 8, 64, classes), 8, 64);
  const std::vector<float> image = random_image(model, 1);
  const std::vector<float> one = OneDnnNetwork(model, Precision::fp32, 1).probabilities(image);
  OneDnnNetwork three(model, Precision::fp32, 3);
  EXPECT_LT(largest_difference(one, three.probabilities(image)), 1e-5);
  EXPECT_EQ(three.engine(), "oneDNN fp32, 3 threads");
}

TEST(OneDnnNetwork, ForgetsTheImageBefore) {
  const ModelDescription model = written(test::darknet_bytes(21, 8, 2, 64, classes), 2, 64);
  OneDnnNetwork network(model, Precision::fp32);
  const std::vector<float> first = network.probabilities(random_image(model, 1));
  (void)network.probabilities(random_image(model, 2));
  EXPECT_EQ(network.probabilities(random_image(model, 1)), first);
}

TEST(OneDnnNetwork, RunsActivationsAndSumsThatNoConvolutionCanTakeIn) {
  // Each convolution's result is read twice, so that nothing can be fused.
  OnnxBuilder network(5, 6, 10);
  const Window same{.kernel = {3, 3}, .padding = {1, 1}};
  const std::string a = network.convolve("input", 6, same);
  const std::string b = network.node("Relu", {a}, 6);
  const std::string c = network.add(network.add(a, b), network.activate(b));
  expect_parity(written(network.bytes(network.softmax(network.convolve(c, 4, same))), 6, 10, 4));
}

TEST(OneDnnNetwork, GivesLogitsTheSoftmaxThatTheFileLeavesOut) {
  OnnxBuilder network(5, 4, 8);
  const std::string scores = network.convolve("input", 4, {}, true);
  const ModelDescription model = written(network.bytes(scores), 4, 8, 4);
  const std::vector<float> image = random_image(model, 1);
  const std::vector<float> plain = OneDnnNetwork(model, Precision::fp32).probabilities(image);
  const ModelDescription whole = written(network.bytes(network.softmax(scores)), 4, 8, 4);
  EXPECT_LT(largest_difference(plain, plain_probabilities(whole, image)), 1e-5);
}

Int8Calibration calibrate(const ModelDescription& model, unsigned images) {
  OneDnnNetwork network(model, Precision::fp32);
  ActivationRanges ranges;
  for (unsigned seed = 0; seed < images; ++seed) {
    network.observe(random_image(model, seed),
                    [&](const std::string& name, auto values, std::size_t channels) {
                      ranges.add(name, values, channels);
                    });
  }
  return {.made = "test", .range_of_channels = ranges.ranges(1.0), .float_layers = {}};
}

double mean_difference(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += std::abs(a[i] - b[i]);
  return sum / static_cast<double>(a.size());
}

class Int8Network : public ::testing::TestWithParam<const char*> {
 protected:
  static ModelDescription model() {
    const bool light = std::string(GetParam()) == "light";
    return light ? written(test::light_bytes(16, 16, 64, classes), 16, 64)
                 : written(test::darknet_bytes(21, 16, 8, 64, classes), 8, 64);
  }
};

TEST_P(Int8Network, StaysNearFloatingPoint) {
  ModelDescription calibrated = model();
  calibrated.int8 = calibrate(calibrated, 4);
  OneDnnNetwork integers(calibrated, Precision::int8);
  OneDnnNetwork floats(calibrated, Precision::fp32);
  EXPECT_THAT(integers.engine(), HasSubstr("int8"));
  EXPECT_LT(integers.memory_bytes(), floats.memory_bytes() / 2);
  // Random weights keep nothing of a class: the logits of pixels are near each other, and so this
  // is no measure of what int8 costs a trained network.
  for (unsigned seed = 10; seed < 13; ++seed) {
    const std::vector<float> image = random_image(calibrated, seed);
    const std::vector<float> exact = floats.probabilities(image);
    const std::vector<float> rounded = integers.probabilities(image);
    EXPECT_LT(mean_difference(exact, rounded), 0.01);
    EXPECT_GT(mean_difference(exact, rounded), 0.0);
  }
}

TEST_P(Int8Network, IsAsGoodAsFloatingPointWhereEveryLayerIsKeptInIt) {
  ModelDescription calibrated = model();
  calibrated.int8 = calibrate(calibrated, 1);
  const NetworkGraph graph = read_network(OnnxFile(calibrated.network_file));
  for (const Layer& layer : graph.layers) calibrated.int8->float_layers.push_back(layer.name);
  const std::vector<float> image = random_image(calibrated, 5);
  EXPECT_LT(largest_difference(OneDnnNetwork(calibrated, Precision::int8).probabilities(image),
                               OneDnnNetwork(calibrated, Precision::fp32).probabilities(image)),
            1e-3);
}

TEST_P(Int8Network, SurvivesImagesFarBeyondItsCalibration) {
  ModelDescription calibrated = model();
  calibrated.int8 = calibrate(calibrated, 1);
  std::vector<float> image = random_image(calibrated, 5);
  for (float& value : image) value *= 1e6F;
  const std::vector<float> result = OneDnnNetwork(calibrated, Precision::int8).probabilities(image);
  EXPECT_TRUE(std::ranges::all_of(result, [](float p) { return p >= 0.0F && p <= 1.0F; }));
}

INSTANTIATE_TEST_SUITE_P(Family, Int8Network, ::testing::Values("light", "darknet21"));

std::string refusal(const ModelDescription& model, Precision precision = Precision::fp32) {
  try {
    const OneDnnNetwork network(model, precision);
    return {};
  } catch (const ModelError& error) {
    EXPECT_THAT(error.what(), HasSubstr(model.network_file.string()));
    return error.what();
  }
}

TEST(OneDnnNetwork, WantsRowsAndColumnsThatItsStridesDivide) {
  ModelDescription model = written(test::light_bytes(8, 0, 0, classes), 8, 36);
  EXPECT_THAT(refusal(model), HasSubstr("columns of its image must be a multiple of 8"));
  model.columns = 32;
  model.rows = 6;
  EXPECT_THAT(refusal(model), HasSubstr("rows of its image must be a multiple of 4"));
  model.rows = 8;
  EXPECT_EQ(refusal(model), "");
}

TEST(OneDnnNetwork, WantsTheImageAndTheClassesOfItsFile) {
  ModelDescription model = written(test::light_bytes(8, 8, 32, classes), 8, 64);
  EXPECT_THAT(refusal(model), HasSubstr("wants an input of 1x5x8x32"));
  model.columns = 32;
  model.classes.pop_back();
  EXPECT_THAT(refusal(model), HasSubstr("output of 1x20x8x32, but 1x19x8x32"));
}

TEST(OneDnnNetwork, NamesTheOperatorAndTheWayOutWhenItCannotRunAModel) {
  OnnxBuilder network(5, 4, 8);
  const ModelDescription model =
      written(network.bytes(network.node("Sigmoid", {"input"}, 5)), 4, 8, 5);
  EXPECT_THROW(OneDnnNetwork(model, Precision::fp32), UnsupportedModel);
  EXPECT_THAT(refusal(model), HasSubstr("operator Sigmoid"));
  EXPECT_THAT(refusal(model), HasSubstr("engine: opencv"));
}

TEST(OneDnnNetwork, RefusesADamagedCalibration) {
  ModelDescription model = written(test::light_bytes(8, 8, 32, classes), 8, 32);
  const Int8Calibration sound = calibrate(model, 1);
  const auto refused_with = [&](const auto& damage) -> std::string {
    model.int8 = sound;
    for (auto& [tensor, ranges] : model.int8->range_of_channels) damage(ranges);
    try {
      const OneDnnNetwork network(model, Precision::int8);
      return {};
    } catch (const ModelError& error) {
      return error.what();
    }
  };
  const std::string zeros = refused_with([](auto& ranges) { std::ranges::fill(ranges, 0.0F); });
  EXPECT_THAT(zeros, HasSubstr("int8.yaml: ranges: '"));
  EXPECT_THAT(zeros, HasSubstr("zeros"));
  EXPECT_THAT(zeros, HasSubstr("stillmap model calibrate"));
  EXPECT_THAT(refused_with([](auto& ranges) { ranges.pop_back(); }), HasSubstr("channels"));
  EXPECT_EQ(refused_with([](auto&) {}), "");
}

TEST(OneDnnNetwork, RefusesACalibrationOfAnotherNetworkOrOfLayersThatItDoesNotHave) {
  ModelDescription model = written(test::light_bytes(8, 8, 32, classes), 8, 32);
  model.int8 = calibrate(model, 1);
  const auto fault = [&]() -> std::string {
    try {
      const OneDnnNetwork network(model, Precision::int8);
      return {};
    } catch (const ModelError& error) {
      return error.what();
    }
  };
  EXPECT_EQ(fault(), "") << "of an older version";
  model.int8->network_crc32 = crc32_of(model.network_file);
  EXPECT_EQ(fault(), "");
  model.int8->float_layers = {"nonsense"};
  EXPECT_THAT(fault(), HasSubstr("float_layers: 'nonsense' is no layer"));
  model.int8->float_layers.clear();
  // The name of its producer: the file stays sound.
  std::ofstream(model.network_file, std::ios::binary | std::ios::app) << "\x12\x01x";
  EXPECT_THAT(fault(), AllOf(HasSubstr("int8.yaml"), HasSubstr(crc32_of(model.network_file)),
                             HasSubstr("stillmap model calibrate")));
}

TEST(OneDnnNetwork, SaysHowToCalibrateWhenThereIsNoCalibration) {
  ModelDescription model = written(test::light_bytes(8, 8, 32, classes), 8, 32);
  EXPECT_THAT(refusal(model, Precision::int8), HasSubstr("stillmap model calibrate"));
  model.int8 =
      Int8Calibration{.made = "", .range_of_channels = {{"x", {1.0F}}}, .float_layers = {}};
  EXPECT_THAT(refusal(model, Precision::int8), HasSubstr("calibrate again"));
}

TEST(OneDnnNetwork, CountsItsOperations) {
  OnnxBuilder network(5, 4, 8);
  const std::string x =
      network.convolve("input", 6, {.kernel = {3, 3}, .stride = {1, 2}, .padding = {1, 1}});
  const std::string y = network.transpose(x, 3, {.kernel = {1, 2}, .stride = {1, 2}});
  const OneDnnNetwork counted(written(network.bytes(y), 4, 8, 3), Precision::fp32);
  EXPECT_NEAR(counted.giga_operations() * 1e9, 2.0 * (4 * 4 * 6 * 5 * 9 + 4 * 4 * 2 * 3 * 6), 0.5);
}

}  // namespace
}  // namespace stillmap
