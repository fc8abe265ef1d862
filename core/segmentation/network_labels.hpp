#pragma once

#include <memory>
#include <string>

#include "core/segmentation/label_source.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// Labels from a network on range images (RangeNet++): projection, network, k-NN votes.
class NetworkLabels final : public LabelSource {
 public:
  /// `network` fits `model`, which has no faults.
  NetworkLabels(ModelDescription model, std::unique_ptr<SegmentationNetwork> network);

  [[nodiscard]] std::string name() const override { return model_.name; }
  [[nodiscard]] PointLabels label(const Scan& scan) override;

 private:
  ModelDescription model_;
  std::unique_ptr<SegmentationNetwork> network_;
};

/// Loads the network that `model` describes. Throws ModelError naming the file and the fault.
[[nodiscard]] std::unique_ptr<LabelSource> open_model(const ModelDescription& model);

}  // namespace stillmap
