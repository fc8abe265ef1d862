#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// How a network is to be run.
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
  /// Why it is slower than it could be; empty when it is not.
  std::string remark;
};

/// Loads the network that `model` describes into the engine that was chosen. Throws ModelError.
[[nodiscard]] OpenedNetwork open_network(const ModelDescription& model,
                                         const EngineOptions& choice);

/// A description that lets a network file be run which has none, as for measuring its speed: the
/// size that the file declares or else rows x columns, no normalisation, outputs without a meaning.
/// Throws ModelError.
[[nodiscard]] ModelDescription describe_bare_network(const std::filesystem::path& network_file,
                                                     int rows, int columns);

}  // namespace stillmap
