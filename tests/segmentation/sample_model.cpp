#include "tests/segmentation/sample_model.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "tests/segmentation/onnx_builder.hpp"

namespace stillmap::test {

ModelDescription describe_family(int rows, int columns, int outputs) {
  ModelDescription model;
  model.name = "tiny";
  model.rows = rows;
  model.columns = columns;
  model.fov_up = 0.2;
  model.fov_down = -0.4;
  model.statistics = {.mean = {12.0F, 10.0F, 0.2F, -1.0F, 0.2F},
                      .deviation = {12.0F, 11.0F, 7.0F, 0.9F, 0.2F}};
  for (int i = 0; i < outputs; ++i) model.classes.push_back(static_cast<SemanticClass>(i));
  return model;
}

ModelDescription describe(const TinyNetwork& network) {
  return describe_family(network.rows, network.columns, static_cast<int>(network.bias.size()));
}

Scan random_scan(std::size_t points, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> level(-15.0F, 15.0F);
  std::uniform_real_distribution<float> height(-3.0F, 1.0F);
  std::uniform_real_distribution<float> share(0.0F, 1.0F);
  Scan scan;
  for (std::size_t i = 0; i < points; ++i) {
    scan.points_lidar.emplace_back(level(random), level(random), height(random));
    scan.intensity.push_back(share(random));
  }
  return scan;
}

RangeImage project(const Scan& scan, const ModelDescription& model) {
  return {scan.points_lidar, model.projection()};
}

std::vector<float> random_image(const ModelDescription& model, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> any(0.0F, 1.0F);
  const auto pixels =
      static_cast<std::size_t>(model.rows) * static_cast<std::size_t>(model.columns);
  std::vector<float> image(model.input_size());
  for (float& value : image) value = any(random);
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (i % pixels % 7 == 3) image[i] = 0.0F;
  }
  return image;
}

TinyNetwork random_network(int rows, int columns, int classes) {
  TinyNetwork network{.rows = rows, .columns = columns};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> any(-1.0F, 1.0F);
  for (int i = 0; i < classes * 5; ++i) network.weights.push_back(any(random));
  for (int i = 0; i < classes; ++i) network.bias.push_back(any(random));
  return network;
}

std::string onnx_bytes(const TinyNetwork& network) {
  const auto classes = static_cast<std::int64_t>(network.bias.size());
  Message graph;
  graph.message(1, onnx_node(network.operation, {"input", "weights", "bias"}, "logits",
                             {ints_attribute("kernel_shape", {1, 1})}));
  if (network.softmax) {
    graph.message(1, onnx_node("Softmax", {"logits"}, "probabilities", {int_attribute("axis", 1)}));
  }
  graph.bytes(2, "tiny")
      .message(5,
               float_tensor("weights", {classes, network.weight_channels, 1, 1}, network.weights))
      .message(5, float_tensor("bias", {classes}, network.bias))
      .message(11, value_info("input", {1, network.input_channels, network.rows, network.columns}))
      .message(12, value_info(network.softmax ? "probabilities" : "logits",
                              {1, classes, network.rows, network.columns}));
  return onnx_file(graph);
}

std::filesystem::path write_model(const std::string& bytes) {
  const auto* const test = ::testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder = std::filesystem::path(::testing::TempDir()) /
                                       (std::string(test->test_suite_name()) + "." + test->name());
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "model.onnx", std::ios::binary) << bytes;
  return folder / "model.onnx";
}

}  // namespace stillmap::test
