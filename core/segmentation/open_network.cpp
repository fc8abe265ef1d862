#include "core/segmentation/open_network.hpp"

#include "core/segmentation/model_error.hpp"
#include "core/segmentation/onednn_network.hpp"
#include "core/segmentation/opencv_network.hpp"

namespace stillmap {
namespace {

using Engine = EngineOptions::Engine;
using PrecisionMode = EngineOptions::PrecisionMode;

Precision precision_of(const ModelDescription& model, PrecisionMode wanted) {
  if (wanted == PrecisionMode::automatic) return model.int8 ? Precision::int8 : Precision::fp32;
  return wanted == PrecisionMode::int8 ? Precision::int8 : Precision::fp32;
}

OpenedNetwork open_with_onednn(const ModelDescription& model, const EngineOptions& choice) {
  const Precision precision = precision_of(model, choice.precision);
  const bool could_be_faster = choice.precision == PrecisionMode::automatic && !model.int8;
  return {.network = std::make_unique<OneDnnNetwork>(model, precision, choice.threads),
          .remark = could_be_faster
                        ? "int8 would be faster, but the model is not calibrated for it: "
                          "'stillmap model calibrate' does it"
                        : ""};
}

OpenedNetwork open_with_opencv(const ModelDescription& model, const EngineOptions& choice,
                               std::string remark) {
  if (choice.precision == PrecisionMode::int8) {
    throw ModelError(model.network_file,
                     "cannot run in int8 on OpenCV; use precision: auto or fp32");
  }
  return {.network = std::make_unique<OpenCvNetwork>(model), .remark = std::move(remark)};
}

}  // namespace

OpenedNetwork open_network(const ModelDescription& model, const EngineOptions& choice) {
  if (choice.engine == Engine::opencv) return open_with_opencv(model, choice, "");
  if (choice.engine == Engine::onednn || choice.precision == PrecisionMode::int8) {
    return open_with_onednn(model, choice);
  }
  try {
    return open_with_onednn(model, choice);
  } catch (const UnsupportedModel& error) {
    return open_with_opencv(model, choice,
                            std::string("OpenCV runs it, several times slower: ") + error.what());
  }
}

}  // namespace stillmap
