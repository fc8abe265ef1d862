#include "core/segmentation/opencv_network.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <new>
#include <opencv2/dnn.hpp>
#include <string>
#include <vector>

#include "core/segmentation/model_error.hpp"
#include "core/segmentation/network_input.hpp"
#include "core/segmentation/onnx/onnx_file.hpp"
#include "core/segmentation/pixel_scores.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// That is no fault of the model: it may work when the program is started again.
void rethrow_if_out_of_memory(const cv::Exception& error) {
  if (error.code == cv::Error::StsNoMem) throw std::bad_alloc();
}

cv::dnn::Net read_with_opencv(const fs::path& file) {
  try {
    cv::dnn::Net net = cv::dnn::readNetFromONNX(file.string());
    if (net.empty()) throw ModelError(file, "holds no network");
    net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    return net;
  } catch (const cv::Exception& error) {
    rethrow_if_out_of_memory(error);
    throw ModelError(file,
                     "is not an ONNX network that OpenCV can read (truncated, damaged, or "
                     "with an operator that it does not know): " +
                         error.err);
  }
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

}  // namespace

struct OpenCvNetwork::State {
  cv::dnn::Net net;
  std::array<int, 4> input_shape;
  std::array<int, 4> output_shape;
  ScoreKind kind = ScoreKind::logits;

  cv::Mat forward(std::span<const float> input) {
    // setInput() copies from the pointer and does not write to it.
    const cv::Mat tensor(static_cast<int>(input_shape.size()), input_shape.data(), CV_32F,
                         const_cast<float*>(input.data()));
    net.setInput(tensor);
    return net.forward();
  }

  [[nodiscard]] std::span<const float> scores(const cv::Mat& output) const {
    return {output.ptr<float>(), output.total()};
  }

  /// Runs the network once, so that a model that does not fit is refused on loading.
  void try_once(const ModelDescription& model);
  void require_output_shape(const cv::Mat& output, const fs::path& file) const;
};

void OpenCvNetwork::State::try_once(const ModelDescription& model) {
  const std::vector<float> input = trial_input(model);
  cv::Mat output;
  try {
    output = forward(input);
  } catch (const cv::Exception& error) {
    rethrow_if_out_of_memory(error);
    throw ModelError(model.network_file,
                     "does not run on an input of " + shape_text(input_shape) +
                         " (1 x 5 x rows x columns of its description): " + error.err);
  }
  require_output_shape(output, model.network_file);
  require_finite_scores(model, scores(output));
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
  require_valid(model);
  const auto channels = static_cast<int>(model.statistics.channels);
  // OpenCV checks neither the file's consistency nor its declared input shape.
  require_input_shape(OnnxFile(model.network_file), channels, model.rows, model.columns);
  state_->net = read_with_opencv(model.network_file);
  state_->input_shape = {1, channels, model.rows, model.columns};
  state_->output_shape = {1, static_cast<int>(model.classes.size()), model.rows, model.columns};
  state_->try_once(model);
}

OpenCvNetwork::~OpenCvNetwork() = default;

PixelOutputs OpenCvNetwork::run(std::span<const float> input) {
  assert(input.size() == static_cast<std::size_t>(state_->input_shape[1] * state_->input_shape[2] *
                                                  state_->input_shape[3]));
  const cv::Mat output = state_->forward(input);
  return argmax_outputs(state_->scores(output), static_cast<std::size_t>(state_->output_shape[1]),
                        state_->kind);
}

std::vector<float> OpenCvNetwork::probabilities(std::span<const float> input) {
  const cv::Mat output = state_->forward(input);
  return probabilities_of(state_->scores(output), static_cast<std::size_t>(state_->output_shape[1]),
                          state_->kind);
}

}  // namespace stillmap
