#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/lidar/range_image.hpp"
#include "core/lidar/semantic_class.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/segmentation/int8_calibration.hpp"
#include "core/segmentation/island_votes.hpp"
#include "core/segmentation/knn_postprocess.hpp"
#include "core/segmentation/lidar_tilt.hpp"
#include "core/segmentation/voxel_votes.hpp"

namespace stillmap {

/// Channels of a network's input, in this order.
enum class InputChannel : std::uint8_t {
  range,  ///< [m]
  x,      ///< [m], as y and z in the lidar's frame
  y,
  z,
  remission,  ///< 0..1
  slope,      ///< [rad]; see surface_slope_rad()
};
inline constexpr std::size_t max_input_channels = 6;
/// As model.yaml and the training scripts call them.
inline constexpr std::array<std::string_view, max_input_channels> input_channel_names{
    "range", "x", "y", "z", "remission", "slope"};
/// RangeNet++'s: without the slope.
inline constexpr std::size_t plain_input_channels = 5;

[[nodiscard]] constexpr std::size_t index(InputChannel channel) {
  return static_cast<std::size_t>(channel);
}

/// Widths of range images that a user can choose; a model's own may be smaller.
inline constexpr int min_image_columns = 16;
inline constexpr int max_image_columns = 8192;

/// The channels that a network takes, the first so many, and mean and standard deviation of each
/// over the training set.
struct InputStatistics {
  std::size_t channels = plain_input_channels;
  std::array<float, max_input_channels> mean{};
  std::array<float, max_input_channels> deviation{};
};

/// Lidars whose scans a model has seen, or ones between them. Angles in radians.
struct TrainedSensors {
  int min_rings = 1;
  int max_rings = 1;
  double fov_up = 0.0;
  double fov_down = 0.0;
};

/// A network's input, output and post-processing; model.yaml in a model folder.
struct ModelDescription {
  std::string name;
  std::string licence;
  /// Sensors that it was trained for, training and accuracy, in words.
  std::string sensor;
  std::string training;
  std::string accuracy;
  /// Nothing where that is not known.
  std::optional<TrainedSensors> trained_for;
  /// The weights, an ONNX file.
  std::filesystem::path network_file;

  /// Size of the range image.
  int rows = 64;
  int columns = 1024;
  /// Smallest width that it was trained for, used on machines that are too slow for `columns`; 0
  /// when it has one width only.
  int min_columns = 0;
  /// Upper and lower edge of the image [rad]; points beyond are clamped to the edge rows.
  double fov_up = 0.0;
  double fov_down = 0.0;
  /// Trained for many sensors: the image takes its field of view from the sensor, and so many rows
  /// as suit it. See for_sensor().
  bool follow_sensor = false;
  /// Where no mount tells how the lidar leans and how high it is, the ground that it sees does (see
  /// stance_over_ground()). False: then it counts as upright, at `lidar_height_m`.
  bool finds_stance = true;
  /// The network sees each scan in a mirror, too. See run_mirrored_too().
  bool mirrored = false;
  InputStatistics statistics;

  /// Entry n is the class of the network's output n.
  std::vector<SemanticClass> classes;
  /// Without it a point takes the class of its pixel.
  std::optional<KnnConfig> knn;
  /// Points vote once more in space, all of them, then those that are unsure, then what surrounds
  /// vehicles and the ground below them; without one of these, that vote does not take place.
  std::optional<VoxelVoteConfig> voxel_votes;
  std::optional<UnsureVoteConfig> unsure_votes;
  std::optional<IslandVoteConfig> island_votes;
  /// Leaves the scan's point 0 out of the image, as lidar-bonnetal's mask does. For parity tests.
  bool mask_first_point = false;
  /// Without it the network cannot run in 8-bit integers.
  std::optional<Int8Calibration> int8;
  /// Height above the ground of most lidars that it has seen [m]; of a lidar at another one z is
  /// moved to that. Nothing: z stays.
  std::optional<double> lidar_height_m;

  /// Values of one input: channels x rows x columns.
  [[nodiscard]] std::size_t input_size() const {
    return statistics.channels * static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
  }
  [[nodiscard]] ProjectionModel projection() const {
    return {.rows = rows, .columns = columns, .fov_up = fov_up, .fov_down = fov_down};
  }
  /// Every fault in words, one a line; empty when the description can be used.
  [[nodiscard]] std::string faults() const;
};

/// Throws ModelError when the description has faults.
void require_valid(const ModelDescription& model);

/// "16 to 64 beams from +15 to -31.4 degrees".
[[nodiscard]] std::string in_words(const TrainedSensors& seen);

/// Whether `model` is made for this sensor more than `other`: its scans are less beyond what the
/// model has seen (a factor of 2 in beams or in columns counts as much as the whole field of view);
/// of two that have seen such scans, the one that has seen fewer other sensors. False where one of
/// them does not say what it was trained for, and for irregular patterns.
[[nodiscard]] bool fits_better(const ModelDescription& model, const ModelDescription& other,
                               const SensorModel& sensor);

/// The model with the image for this sensor. With follow_sensor: the sensor's field of view in rows
/// half way between its rings and `rows` of the model (about twice the rings at most, but 8 rows at
/// least, and twice those of the model at most; the nearest multiple of 8), and for sensors of few
/// rings a limit on the columns. Of a sensor that leans so much that its image is turned, up to
/// half as many rows more. Else unchanged.
[[nodiscard]] ModelDescription for_sensor(ModelDescription model, const SensorModel& sensor,
                                          const LidarTilt& tilt = {});

}  // namespace stillmap
