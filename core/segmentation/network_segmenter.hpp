#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/open_network.hpp"
#include "core/segmentation/segmentation_network.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap {

/// The classes of a network's outputs; unlabeled for PixelOutputs::no_output.
[[nodiscard]] PixelLabels pixel_labels(PixelOutputs&& outputs, const ModelDescription& model);

/// Labels from a network on range images (RangeNet++): projection, inference, k-NN post-processing.
class NetworkSegmenter final : public Segmenter {
 public:
  /// `network` was opened for `model`, which has no faults. `remark` is appended to details().
  NetworkSegmenter(ModelDescription model, std::unique_ptr<SegmentationNetwork> network,
                   std::string remark = {});

  /// Adds a resolution level: the same model with fewer columns than all levels before.
  void add_lower_resolution(int columns, std::unique_ptr<SegmentationNetwork> network);

  [[nodiscard]] std::string name() const override { return model_.name; }
  [[nodiscard]] std::string details() const override;
  [[nodiscard]] std::vector<double> relative_costs() const override;
  void set_resolution_level(std::size_t resolution_level) override;
  [[nodiscard]] int image_columns() const override { return model_.columns; }
  [[nodiscard]] PointLabels segment(const Scan& scan) override;

 private:
  struct Level {
    int columns = 0;
    std::unique_ptr<SegmentationNetwork> network;
  };

  /// With the columns of the current level.
  ModelDescription model_;
  std::vector<Level> levels_;
  std::size_t current_level_ = 0;
  std::string remark_;
};

/// Loads the network that `model` describes. Throws ModelError naming the file and the fault.
[[nodiscard]] std::unique_ptr<Segmenter> open_model(const ModelDescription& model,
                                                    const EngineOptions& choice = {});
/// The same with resolution levels down to the model's min_columns, where it has any.
[[nodiscard]] std::unique_ptr<Segmenter> open_multi_resolution_model(
    const ModelDescription& model, const EngineOptions& choice = {});

}  // namespace stillmap
