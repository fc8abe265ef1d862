#include "core/segmentation/model_description.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "core/segmentation/model_error.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {
namespace {

constexpr std::array<std::string_view, input_channels> channel_names{"range", "x", "y", "z",
                                                                     "remission"};
constexpr int max_rows = 512;
/// Lidars of few beams fire some 1800 times per revolution (VLP-16 at 10 Hz), others 2100 times and
/// more. An image with more columns than that has empty ones everywhere, unlike all training
/// images.
constexpr int few_beams = 16;
constexpr int columns_of_few_beams = 1536;

std::string statistics_faults(const InputStatistics& statistics) {
  std::string faults;
  for (std::size_t i = 0; i < input_channels; ++i) {
    const std::string channel(channel_names[i]);
    if (!std::isfinite(statistics.mean[i])) {
      faults += "mean of " + channel + " is not a finite number\n";
    }
    if (!(std::isfinite(statistics.deviation[i]) && statistics.deviation[i] > 0.0F)) {
      faults += "deviation of " + channel + " is " + std::to_string(statistics.deviation[i]) +
                ", but must be above 0\n";
    }
  }
  return faults;
}

std::string between(const char* field, int value, int max) {
  if (value >= 1 && value <= max) return {};
  return std::string(field) + " is " + std::to_string(value) + ", but must be 1.." +
         std::to_string(max) + "\n";
}

}  // namespace

std::string ModelDescription::faults() const {
  std::string faults =
      between("rows", rows, max_rows) + between("columns", columns, max_image_columns);
  if (!(fov_down < fov_up && std::abs(fov_up) < std::numbers::pi / 2 &&
        std::abs(fov_down) < std::numbers::pi / 2)) {
    faults += "fov_down must be below fov_up, both within -90..90 degrees\n";
  }
  faults += statistics_faults(statistics);
  if (classes.empty() || classes.size() > PixelOutputs::max_outputs) {
    faults += "classes has " + std::to_string(classes.size()) + " entries, but must have 1.." +
              std::to_string(PixelOutputs::max_outputs) + "\n";
  }
  if (knn) faults += knn->faults();
  return faults;
}

void require_valid(const ModelDescription& model) {
  if (const std::string faults = model.faults(); !faults.empty()) {
    throw ModelError(model.network_file, "has a description that cannot be used:\n" + faults);
  }
}

ModelDescription for_sensor(ModelDescription model, const SensorModel& sensor) {
  if (!model.follow_sensor) return model;
  model.rows = sensor.rings;
  model.fov_up = sensor.fov_up;
  model.fov_down = sensor.fov_down;
  if (sensor.rings <= few_beams) model.columns = std::min(model.columns, columns_of_few_beams);
  return model;
}

}  // namespace stillmap
