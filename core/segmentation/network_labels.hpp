#pragma once

#include <memory>
#include <string>

#include "core/segmentation/label_source.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/open_network.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// The classes that a network's outputs stand for; unlabeled where it gave none.
[[nodiscard]] PixelLabels pixel_labels(PixelOutputs&& outputs, const ModelDescription& model);

/// Labels from a network on range images (RangeNet++): projection, network, k-NN votes.
class NetworkLabels final : public LabelSource {
 public:
  /// `network` fits `model`, which has no faults. `remark` is what the log should say of it.
  NetworkLabels(ModelDescription model, std::unique_ptr<SegmentationNetwork> network,
                std::string remark = {});

  [[nodiscard]] std::string name() const override { return model_.name; }
  [[nodiscard]] std::string details() const override;
  [[nodiscard]] PointLabels label(const Scan& scan) override;

 private:
  ModelDescription model_;
  std::unique_ptr<SegmentationNetwork> network_;
  std::string remark_;
};

/// Loads the network that `model` describes. Throws ModelError naming the file and the fault.
[[nodiscard]] std::unique_ptr<LabelSource> open_model(const ModelDescription& model,
                                                      const EngineChoice& choice = {});

}  // namespace stillmap
