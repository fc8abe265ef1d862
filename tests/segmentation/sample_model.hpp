#pragma once

#include <random>
#include <vector>

#include "core/segmentation/model_description.hpp"
#include "tests/segmentation/tiny_onnx.hpp"

namespace stillmap::test {

/// Fits a network for images of this size; output n is class n.
inline ModelDescription describe_family(int rows, int columns, int outputs) {
  ModelDescription model;
  model.name = "tiny";
  model.rows = rows;
  model.columns = columns;
  model.fov_up = 0.2;
  model.fov_down = -0.4;
  model.statistics = {.mean = {12.0F, 10.0F, 0.2F, -1.0F, 0.2F},
                      .deviation = {12.0F, 11.0F, 7.0F, 0.9F, 0.2F}};
  for (int i = 0; i < outputs; ++i) model.classes.push_back(static_cast<SemanticClass>(i));
  return model;
}

/// Fits `network`; output n is class n.
inline ModelDescription describe(const TinyNetwork& network) {
  return describe_family(network.rows, network.columns, static_cast<int>(network.bias.size()));
}

/// Points in all directions, several a pixel of a small image, with intensity.
inline Scan random_scan(std::size_t points, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> level(-15.0F, 15.0F);
  std::uniform_real_distribution<float> height(-3.0F, 1.0F);
  std::uniform_real_distribution<float> share(0.0F, 1.0F);
  Scan scan;
  for (std::size_t i = 0; i < points; ++i) {
    scan.points_lidar.emplace_back(level(random), level(random), height(random));
    scan.intensity.push_back(share(random));
  }
  return scan;
}

inline RangeImage project(const Scan& scan, const ModelDescription& model) {
  return {scan.points_lidar, model.projection()};
}

/// Numbers about as large as those of a normalised range image, some pixels empty.
inline std::vector<float> random_image(const ModelDescription& model, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> any(0.0F, 1.0F);
  const auto pixels =
      static_cast<std::size_t>(model.rows) * static_cast<std::size_t>(model.columns);
  std::vector<float> image(input_channels * pixels);
  for (float& value : image) value = any(random);
  for (std::size_t i = 0; i < image.size(); ++i) {
    if (i % pixels % 7 == 3) image[i] = 0.0F;
  }
  return image;
}

}  // namespace stillmap::test
