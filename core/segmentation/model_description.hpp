#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/lidar/range_image.hpp"
#include "core/lidar/semantic_class.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/knn_postprocess.hpp"

namespace stillmap {

/// Channels of the network's input, in this order: range, x, y, z [m], remission (0..1).
inline constexpr std::size_t input_channels = 5;

/// Widths of range images that can be asked for; a model's own may be less than the least.
inline constexpr int min_image_columns = 16;
inline constexpr int max_image_columns = 8192;

/// Mean and standard deviation of each input channel over the training set.
struct InputStatistics {
  std::array<float, input_channels> mean{};
  std::array<float, input_channels> deviation{};
};

/// What must be known of a network to run it and to read its output; model.yaml in a model folder.
struct ModelDescription {
  std::string name;
  std::string licence;
  /// Sensor whose scans it was trained on, in words.
  std::string sensor;
  /// How it was trained and how well it does, in words.
  std::string training;
  std::string accuracy;
  /// The weights, an ONNX file.
  std::filesystem::path network_file;

  /// Range image that the network wants.
  int rows = 64;
  int columns = 1024;
  /// The narrowest image that it was trained for, for machines that are too slow for the usual one;
  /// 0: it knows one width.
  int min_columns = 0;
  /// Upper and lower edge of the image [rad]; points beyond are squeezed into the edge rows.
  double fov_up = 0.0;
  double fov_down = 0.0;
  /// Was trained for many sensors: it takes an image of the rows and the field of view of the
  /// sensor at hand. See for_sensor().
  bool follow_sensor = false;
  InputStatistics statistics;

  /// Entry n is the class of the network's output n.
  std::vector<SemanticClass> classes;
  /// Absent: a point takes the class of its pixel.
  std::optional<KnnConfig> knn;
  /// Leave the scan's point 0 out of the image, as lidar-bonnetal's mask does. For parity tests.
  bool mask_first_point = false;
  /// Absent: it cannot be run in 8-bit integers.
  std::optional<Int8Calibration> int8;

  [[nodiscard]] ProjectionModel projection() const {
    return {.rows = rows, .columns = columns, .fov_up = fov_up, .fov_down = fov_down};
  }
  /// Every fault in words, one a line; empty when the description can be used.
  [[nodiscard]] std::string faults() const;
};

/// The model with the image that it takes of a sensor: as it was trained, or with follow_sensor the
/// sensor's rings as rows over its field of view, and no more columns than a sensor of so many
/// rings fills.
[[nodiscard]] ModelDescription for_sensor(ModelDescription model, const SensorModel& sensor);

}  // namespace stillmap
