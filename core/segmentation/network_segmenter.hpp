#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/open_network.hpp"
#include "core/segmentation/segmentation_network.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// The classes that a network's outputs stand for; unlabeled where it gave none.
[[nodiscard]] PixelLabels pixel_labels(PixelOutputs&& outputs, const ModelDescription& model);

/// Labels from a network on range images (RangeNet++): projection, network, k-NN votes.
class NetworkSegmenter final : public Segmenter {
 public:
  /// `network` fits `model`, which has no faults. `remark` is what the log should say of it.
  NetworkSegmenter(ModelDescription model, std::unique_ptr<SegmentationNetwork> network,
                   std::string remark = {});

  /// Makes it able to look more coarsely: the same model with fewer columns than all so far.
  void add_lower_resolution(int columns, std::unique_ptr<SegmentationNetwork> network);

  [[nodiscard]] std::string name() const override { return model_.name; }
  [[nodiscard]] std::string details() const override;
  [[nodiscard]] std::vector<double> relative_costs() const override;
  void set_resolution_level(std::size_t resolution_level) override;
  [[nodiscard]] int image_columns() const override { return model_.columns; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override;

 private:
  struct Width {
    int columns = 0;
    std::unique_ptr<SegmentationNetwork> network;
  };

  /// With the columns of the width in use.
  ModelDescription model_;
  std::vector<Width> widths_;
  std::size_t in_use_ = 0;
  std::string remark_;
};

/// Loads the network that `model` describes. Throws ModelError naming the file and the fault.
[[nodiscard]] std::unique_ptr<Segmenter> open_model(const ModelDescription& model,
                                                    const EngineOptions& choice = {});
/// The same, able to look more coarsely, down to the model's min_columns.
[[nodiscard]] std::unique_ptr<Segmenter> open_multi_resolution_model(
    const ModelDescription& model, const EngineOptions& choice = {});

}  // namespace stillmap
