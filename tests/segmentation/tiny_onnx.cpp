#include "tests/segmentation/tiny_onnx.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "tests/segmentation/onnx_message.hpp"

namespace stillmap::test {

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
                             {list_attribute("kernel_shape", {1, 1})}));
  if (network.softmax) {
    graph.message(1,
                  onnx_node("Softmax", {"logits"}, "probabilities", {whole_attribute("axis", 1)}));
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
