#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/segmentation/model_description.hpp"

namespace stillmap::test {

/// A network of one 1x1 convolution, 5 channels to `bias.size()` classes, and a soft-max.
struct TinyNetwork {
  int rows = 8;
  int columns = 32;
  /// classes x 5
  std::vector<float> weights = {};
  std::vector<float> bias = {};
  bool softmax = true;
  /// The convolution's operator; another name makes an unknown operator.
  std::string operation = "Conv";
  int input_channels = 5;
  int weight_channels = 5;
};

/// A description of a network for images of this size; output n is class n.
[[nodiscard]] ModelDescription describe_family(int rows, int columns, int outputs);

/// A description of `network`; output n is class n.
[[nodiscard]] ModelDescription describe(const TinyNetwork& network);

/// Points in all directions, several per pixel of a small image, with intensity.
[[nodiscard]] Scan random_scan(std::size_t points, unsigned seed);

[[nodiscard]] RangeImage project(const Scan& scan, const ModelDescription& model);

/// Normally distributed values like those of a normalised range image, some pixels empty.
[[nodiscard]] std::vector<float> random_image(const ModelDescription& model, unsigned seed);

/// Weights and biases from a fixed seed.
[[nodiscard]] TinyNetwork random_network(int rows, int columns, int classes);

/// The network as an ONNX file.
[[nodiscard]] std::string onnx_bytes(const TinyNetwork& network);

/// Writes `bytes` to model.onnx in a new folder for the running test; returns the file.
std::filesystem::path write_model(const std::string& bytes);

}  // namespace stillmap::test
