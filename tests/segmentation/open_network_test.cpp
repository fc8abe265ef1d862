#include "core/segmentation/open_network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "tests/segmentation/onnx_builder.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using Engine = EngineOptions::Engine;
using PrecisionMode = EngineOptions::PrecisionMode;
using ::testing::HasSubstr;

ModelDescription light_model() {
  ModelDescription model = test::describe_family(8, 32, 4);
  model.network_file = test::write_model(test::light_bytes(8, 8, 32, 4));
  return model;
}

ModelDescription calibrated() {
  ModelDescription model = light_model();
  ActivationRanges ranges;
  OneDnnNetwork(model, Precision::fp32)
      .observe(test::random_image(model, 1),
               [&](const std::string& name, auto values, std::size_t channels) {
                 ranges.add(name, values, channels);
               });
  model.int8 = Int8Calibration{.made = "",
                               .range_of_channels = ranges.ranges(1.0),
                               .float_layers = {},
                               .network_crc32 = crc32_of(model.network_file)};
  return model;
}

/// With an operator that only OpenCV supports.
ModelDescription exotic() {
  test::OnnxBuilder network(5, 4, 8);
  ModelDescription model = test::describe_family(4, 8, 4);
  const std::string scores = network.node("Sigmoid", {network.convolve("input", 4, {})}, 4);
  model.network_file = test::write_model(network.bytes(scores));
  return model;
}

std::string engine(const ModelDescription& model, const EngineOptions& choice) {
  return open_network(model, choice).network->engine();
}

TEST(OpenNetwork, TakesTheFastestThatRunsTheModel) {
  EXPECT_THAT(engine(calibrated(), {.threads = 2}), HasSubstr("oneDNN int8, 2 threads"));
  EXPECT_THAT(engine(light_model(), {.threads = 2}), HasSubstr("oneDNN fp32, 2 threads"));
  EXPECT_EQ(engine(exotic(), {}), "OpenCV");
}

TEST(OpenNetwork, RemarksWhyItIsNotFaster) {
  EXPECT_EQ(open_network(calibrated(), {}).remark, "");
  EXPECT_THAT(open_network(light_model(), {}).remark, HasSubstr("stillmap model calibrate"));
  ModelDescription untold = calibrated();
  untold.int8->network_crc32.clear();
  EXPECT_THAT(open_network(untold, {}).remark, HasSubstr("does not say with which model.onnx"));
  EXPECT_EQ(open_network(untold, {.precision = PrecisionMode::fp32}).remark, "");
  EXPECT_THAT(open_network(exotic(), {}).remark, HasSubstr("operator Sigmoid"));
  EXPECT_EQ(open_network(light_model(), {.precision = PrecisionMode::fp32}).remark, "");
}

TEST(OpenNetwork, UsesTheChosenEngineAndPrecision) {
  const ModelDescription model = calibrated();
  EXPECT_EQ(engine(model, {.engine = Engine::opencv}), "OpenCV");
  EXPECT_THAT(engine(model, {.precision = PrecisionMode::fp32}), HasSubstr("oneDNN fp32"));
  EXPECT_THAT(engine(model, {.engine = Engine::onednn, .precision = PrecisionMode::int8}),
              HasSubstr("oneDNN int8"));
}

TEST(OpenNetwork, RefusesImpossibleChoices) {
  EXPECT_THROW((void)open_network(exotic(), {.engine = Engine::onednn}), UnsupportedModel);
  EXPECT_THROW((void)open_network(exotic(), {.precision = PrecisionMode::int8}), ModelError);
  EXPECT_THROW((void)open_network(light_model(), {.precision = PrecisionMode::int8}), ModelError);
  EXPECT_THROW((void)open_network(calibrated(),
                                  {.engine = Engine::opencv, .precision = PrecisionMode::int8}),
               ModelError);
}

TEST(OpenNetwork, DoesNotHideADamagedModelBehindTheFallback) {
  ModelDescription model = light_model();
  model.network_file = test::write_model("not a network");
  try {
    (void)open_network(model, {});
    FAIL() << "it was opened";
  } catch (const ModelError& error) {
    EXPECT_THAT(error.what(), HasSubstr("ONNX"));
  }
}

}  // namespace
}  // namespace stillmap
