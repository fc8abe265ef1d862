#include "core/segmentation/network_labels.hpp"

#include <algorithm>
#include <cassert>
#include <span>
#include <utility>

#include "core/lidar/range_image.hpp"
#include "core/segmentation/network_input.hpp"

namespace stillmap {
namespace {

PointLabels labels_of_own_pixel(const RangeImage& image, const PixelLabels& pixels) {
  return {.classes = unproject(image, std::span<const SemanticClass>(pixels.classes),
                               SemanticClass::unlabeled),
          .confidence = unproject(image, std::span<const float>(pixels.confidence), 0.0F)};
}

}  // namespace

PixelLabels pixel_labels(PixelOutputs&& outputs, const ModelDescription& model) {
  PixelLabels pixels{.classes = std::vector<SemanticClass>(outputs.output.size()),
                     .confidence = std::move(outputs.confidence)};
  std::ranges::transform(outputs.output, pixels.classes.begin(), [&model](std::uint8_t output) {
    return output == PixelOutputs::no_output ? SemanticClass::unlabeled : model.classes[output];
  });
  return pixels;
}

NetworkLabels::NetworkLabels(ModelDescription model, std::unique_ptr<SegmentationNetwork> network,
                             std::string remark)
    : model_(std::move(model)), network_(std::move(network)), remark_(std::move(remark)) {
  assert(network_ && model_.faults().empty());
}

std::string NetworkLabels::details() const {
  const std::string image = std::to_string(model_.rows) + "x" + std::to_string(model_.columns);
  return network_->engine() + ", image " + image + (remark_.empty() ? "" : "; ") + remark_;
}

PointLabels NetworkLabels::label(const Scan& scan) {
  if (scan.empty()) return {};
  const RangeImage image(scan.points_lidar, model_.projection());
  PixelOutputs outputs = network_->run(make_network_input(scan, image, model_));
  const PixelLabels pixels = pixel_labels(std::move(outputs), model_);
  return model_.knn ? knn_labels(image, pixels, *model_.knn) : labels_of_own_pixel(image, pixels);
}

std::unique_ptr<LabelSource> open_model(const ModelDescription& model, const EngineChoice& choice) {
  OpenedNetwork opened = open_network(model, choice);
  return std::make_unique<NetworkLabels>(model, std::move(opened.network),
                                         std::move(opened.remark));
}

}  // namespace stillmap
