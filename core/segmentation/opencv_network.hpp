#pragma once

#include <memory>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// Runs any ONNX network on OpenCV's dnn module: the reference and the fallback for oneDNN.
class OpenCvNetwork final : public SegmentationNetwork {
 public:
  /// Loads the network and runs it once. Throws ModelError when the file cannot be read, holds
  /// weights that are not finite, or does not map 1 x 5 x rows x columns to one score per class.
  explicit OpenCvNetwork(const ModelDescription& model);
  ~OpenCvNetwork() override;

  [[nodiscard]] PixelOutputs run(std::span<const float> input) override;
  [[nodiscard]] std::vector<float> probabilities(std::span<const float> input) override;
  [[nodiscard]] std::string engine() const override { return "OpenCV"; }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
