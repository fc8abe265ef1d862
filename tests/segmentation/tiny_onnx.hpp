#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stillmap::test {

/// A network of one 1x1 convolution, 5 channels to `bias.size()` classes, and a soft-max.
struct TinyNetwork {
  int rows = 8;
  int columns = 32;
  /// classes x 5
  std::vector<float> weights = {};
  std::vector<float> bias = {};
  bool softmax = true;
  /// What the convolution is called; another name makes an operator that nobody knows.
  std::string operation = "Conv";
  int input_channels = 5;
  int weight_channels = 5;
};

/// Weights and biases from a fixed seed.
[[nodiscard]] TinyNetwork random_network(int rows, int columns, int classes);

/// The network as an ONNX file.
[[nodiscard]] std::string onnx_bytes(const TinyNetwork& network);

/// Writes `bytes` to model.onnx in a fresh folder of the running test; returns the file.
std::filesystem::path write_model(const std::string& bytes);

}  // namespace stillmap::test
