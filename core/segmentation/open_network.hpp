#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// Engine, precision and threads of a network.
struct EngineOptions {
  enum class Engine {
    /// oneDNN where it can run the network, else OpenCV.
    automatic,
    onednn,
    opencv,
  };
  enum class PrecisionMode {
    /// int8 where the model has a calibration for it and oneDNN runs it, else fp32.
    automatic,
    fp32,
    int8,
  };

  Engine engine = Engine::automatic;
  PrecisionMode precision = PrecisionMode::automatic;
  /// Threads of oneDNN for one image; 0: all cores.
  int threads = 0;
};

struct OpenedNetwork {
  std::unique_ptr<SegmentationNetwork> network;
  /// Threads that one image is worked on by. The same network opened with one thread may run beside
  /// others, where this is above 1; OpenCV's has the process's threads and says 1.
  int threads = 1;
  /// Why a faster engine or precision could not be used; empty when it is the fastest.
  std::string remark;
};

/// Loads the network of `model` into the chosen engine. Throws ModelError.
[[nodiscard]] OpenedNetwork open_network(const ModelDescription& model,
                                         const EngineOptions& choice);

/// A description for an ONNX file without a model.yaml, to measure its speed: the image size that
/// the file declares, or else rows x columns; no normalisation; all outputs unlabeled. Throws
/// ModelError.
[[nodiscard]] ModelDescription describe_bare_network(const std::filesystem::path& network_file,
                                                     int rows, int columns);

}  // namespace stillmap
