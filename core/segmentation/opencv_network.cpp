#include "core/segmentation/opencv_network.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <fstream>
#include <iterator>
#include <opencv2/dnn.hpp>
#include <string>
#include <vector>

#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onnx_input.hpp"
#include "core/segmentation/pixel_scores.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

cv::dnn::Net read_network(const fs::path& file) {
  if (!fs::is_regular_file(file)) throw ModelError(file, "is not a file that can be read");
  try {
    cv::dnn::Net net = cv::dnn::readNetFromONNX(file.string());
    if (net.empty()) throw ModelError(file, "holds no network");
    net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    return net;
  } catch (const cv::Exception& error) {
    throw ModelError(file,
                     "is not an ONNX network that OpenCV can read (truncated, damaged, or "
                     "with an operator that it does not know): " +
                         error.err);
  }
}

void require_finite_weights(const cv::dnn::Net& net, const fs::path& file) {
  for (const std::string& layer_name : net.getLayerNames()) {
    const cv::Ptr<cv::dnn::Layer> layer = net.getLayer(net.getLayerId(layer_name));
    for (const cv::Mat& weights : layer->blobs) {
      if (weights.depth() != CV_32F || cv::checkRange(weights)) continue;
      throw ModelError(file, "weights of layer " + layer_name + " are not all finite numbers");
    }
  }
}

/// Some image of plausible scores: numbers of both signs that differ from pixel to pixel.
std::vector<float> trial_input(std::size_t size) {
  std::vector<float> input(size);
  for (std::size_t i = 0; i < size; ++i) input[i] = std::sin(0.37F * static_cast<float>(i % 9973));
  return input;
}

template <typename Sizes>
std::string shape_text(const Sizes& sizes) {
  std::string text;
  for (const auto size : sizes) {
    if (!text.empty()) text += 'x';
    text += std::to_string(size);
  }
  return text;
}

std::string read_bytes(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void require_input_shape(const fs::path& file, std::span<const int> wanted) {
  const std::vector<std::int64_t> declared = declared_input_shape(read_bytes(file));
  const auto fits = [](std::int64_t size, int wanted_size) {
    return size == 0 || size == wanted_size;
  };
  if (declared.empty() || std::ranges::equal(declared, wanted, fits)) return;
  throw ModelError(file, "wants an input of " + shape_text(declared) +
                             ", but its description has " + shape_text(wanted) +
                             " (1 x 5 x rows x columns)");
}

}  // namespace

struct OpenCvNetwork::State {
  cv::dnn::Net net;
  std::array<int, 4> input_shape;
  std::array<int, 4> output_shape;
  ScoreKind kind = ScoreKind::logits;

  cv::Mat forward(std::span<const float> input) {
    // setInput() copies, it does not write through the pointer.
    const cv::Mat tensor(static_cast<int>(input_shape.size()), input_shape.data(), CV_32F,
                         const_cast<float*>(input.data()));
    net.setInput(tensor);
    return net.forward();
  }

  [[nodiscard]] std::span<const float> scores(const cv::Mat& output) const {
    return {output.ptr<float>(), output.total()};
  }

  /// Runs the network once, so that a model that does not fit is found at the start.
  void try_once(const fs::path& file);
  void require_output_shape(const cv::Mat& output, const fs::path& file) const;
};

void OpenCvNetwork::State::try_once(const fs::path& file) {
  const std::vector<float> input =
      trial_input(input_channels * static_cast<std::size_t>(input_shape[2] * input_shape[3]));
  cv::Mat output;
  try {
    output = forward(input);
  } catch (const cv::Exception& error) {
    throw ModelError(file, "does not run on an input of " + shape_text(input_shape) +
                               " (1 x 5 x rows x columns of its description): " + error.err);
  }
  require_output_shape(output, file);
  if (!cv::checkRange(output)) {
    throw ModelError(file, "gives scores that are not finite numbers");
  }
  kind = score_kind(scores(output), static_cast<std::size_t>(output_shape[1]));
}

void OpenCvNetwork::State::require_output_shape(const cv::Mat& output, const fs::path& file) const {
  const std::span<const int> sizes(output.size.p, static_cast<std::size_t>(output.dims));
  const bool right = output.type() == CV_32F && output.isContinuous();
  if (right && std::ranges::equal(sizes, output_shape)) return;
  throw ModelError(file, "gives an output of " + shape_text(sizes) + ", but " +
                             shape_text(output_shape) +
                             " is wanted (1 x classes x rows x columns of its description)");
}

OpenCvNetwork::OpenCvNetwork(const ModelDescription& model) : state_(std::make_unique<State>()) {
  if (const std::string faults = model.faults(); !faults.empty()) {
    throw ModelError(model.network_file, "has a description that cannot be used:\n" + faults);
  }
  const auto classes = static_cast<int>(model.classes.size());
  state_->net = read_network(model.network_file);
  state_->input_shape = {1, static_cast<int>(input_channels), model.rows, model.columns};
  state_->output_shape = {1, classes, model.rows, model.columns};
  require_input_shape(model.network_file, state_->input_shape);
  require_finite_weights(state_->net, model.network_file);
  state_->try_once(model.network_file);
}

OpenCvNetwork::~OpenCvNetwork() = default;

PixelOutputs OpenCvNetwork::run(std::span<const float> input) {
  assert(input.size() == input_channels * static_cast<std::size_t>(state_->input_shape[2] *
                                                                   state_->input_shape[3]));
  const cv::Mat output = state_->forward(input);
  return most_probable(state_->scores(output), static_cast<std::size_t>(state_->output_shape[1]),
                       state_->kind);
}

}  // namespace stillmap
