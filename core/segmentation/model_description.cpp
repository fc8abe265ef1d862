#include "core/segmentation/model_description.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <string_view>
#include <vector>

#include "core/lidar/ranked_value.hpp"
#include "core/segmentation/model_error.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {
namespace {

constexpr int max_rows = 512;
/// Lidars of few beams fire some 1800 times per revolution (VLP-16 at 10 Hz), others 2100 times and
/// more. An image with more columns than that has empty ones everywhere, unlike all training
/// images.
constexpr int few_beams = 16;
constexpr int columns_of_few_beams = 1536;
/// Networks that halve an image's rows take multiples of that: street those of 4.
constexpr int row_multiple = 8;

std::string statistics_faults(const InputStatistics& statistics) {
  std::string faults;
  for (std::size_t i = 0; i < statistics.channels; ++i) {
    const std::string channel(input_channel_names[i]);
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

/// How far the sensor lies outside of what the model has seen: factors of 2 in beams and in
/// columns, and the share of its field of view.
double misfit(const ModelDescription& model, const SensorModel& sensor) {
  const TrainedSensors& seen = *model.trained_for;
  const int nearest_rings = std::clamp(sensor.rings, seen.min_rings, seen.max_rings);
  const double beams = std::abs(std::log2(static_cast<double>(sensor.rings) / nearest_rings));
  const double beyond =
      std::max(0.0, sensor.fov_up - seen.fov_up) + std::max(0.0, seen.fov_down - sensor.fov_down);
  const double columns = std::log2(static_cast<double>(sensor.columns) / model.columns);
  return beams + beyond / (sensor.fov_up - sensor.fov_down) + std::max(0.0, columns);
}

/// Beams that evenly spaced ones would be if they lay as close as most of the sensor's do: of an
/// uneven sensor more than it has, but not more than the model's own images have rows.
double beams_by_step(const SensorModel& sensor, int usual_rows) {
  const std::vector<double>& beams = sensor.beam_elevations;
  if (beams.size() < 2) return sensor.rings;
  std::vector<double> steps;
  for (std::size_t i = 1; i < beams.size(); ++i) steps.push_back(beams[i - 1] - beams[i]);
  const double close = (sensor.fov_up - sensor.fov_down) / median_of(steps);
  return std::max<double>(sensor.rings, std::min<double>(close, usual_rows));
}

/// Half way between the sensor's beams and the rows of the model's own images, which its filters
/// fit: in fewer rows everything is lower than in those, and more of them stay empty in more. At
/// most every second one does, as between the beams of an HDL-64E, and no image has more than twice
/// the model's. The beams of several lidars share a wider field of view, and lie between each other
/// somewhere. Bands have no empty rows between them that others would fill.
double image_rows(const SensorModel& sensor, int usual_rows) {
  double rows = sensor.rings;
  if (sensor.pattern != ScanPattern::irregular) {
    rows = 0.5 * (beams_by_step(sensor, usual_rows) + usual_rows);
    if (sensor.pattern == ScanPattern::merged) rows = std::max<double>(rows, usual_rows);
    rows = std::min(rows, 2.0 * sensor.rings);
  }
  return std::min(rows, 2.0 * usual_rows);
}

/// The wider field of view of a turned image has as many rows for an angle, as far as half as many
/// more go.
double growth_of_rows(const ModelDescription& upright, const LidarTilt& tilt) {
  const ProjectionModel widened = tilt.widened(upright.projection());
  const double growth = (widened.fov_up - widened.fov_down) / (upright.fov_up - upright.fov_down);
  return std::clamp(growth, 1.0, 1.5);
}

int to_multiple(double rows) {
  return std::max(1, static_cast<int>(std::lround(rows / row_multiple))) * row_multiple;
}

/// Angle for people.
std::string degrees(double radians) {
  std::ostringstream text;
  text << std::showpos << std::round(10.0 * radians * 180.0 / std::numbers::pi) / 10.0;
  return text.str();
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
  if (!(fov_down < fov_up && std::abs(fov_up) <= std::numbers::pi / 2 &&
        std::abs(fov_down) <= std::numbers::pi / 2)) {
    faults += "fov_down must be below fov_up, both within -90..90 degrees\n";
  }
  faults += statistics_faults(statistics);
  if (trained_for &&
      !(trained_for->min_rings >= 1 && trained_for->min_rings <= trained_for->max_rings &&
        trained_for->fov_down < trained_for->fov_up)) {
    faults += "trained_for must have min_beams up to max_beams, and fov_down below fov_up\n";
  }
  if (classes.empty() || classes.size() > PixelOutputs::max_outputs) {
    faults += "classes has " + std::to_string(classes.size()) + " entries, but must have 1.." +
              std::to_string(PixelOutputs::max_outputs) + "\n";
  }
  if (knn) faults += knn->faults();
  if (voxel_votes) faults += voxel_votes->faults();
  if (unsure_votes) faults += unsure_votes->faults();
  if (island_votes) faults += island_votes->faults();
  return faults;
}

void require_valid(const ModelDescription& model) {
  if (const std::string faults = model.faults(); !faults.empty()) {
    throw ModelError(model.network_file, "has a description that cannot be used:\n" + faults);
  }
}

std::string in_words(const TrainedSensors& seen) {
  return (seen.min_rings < seen.max_rings ? std::to_string(seen.min_rings) + " to " : "") +
         std::to_string(seen.max_rings) + " beams from " + degrees(seen.fov_up) + " to " +
         degrees(seen.fov_down) + " degrees";
}

bool fits_better(const ModelDescription& model, const ModelDescription& other,
                 const SensorModel& sensor) {
  if (!model.trained_for || !other.trained_for || sensor.pattern != ScanPattern::rings)
    return false;
  // Less than what sensors of one type differ by.
  constexpr double as_good = 0.1;
  const double difference = misfit(other, sensor) - misfit(model, sensor);
  if (std::abs(difference) > as_good) return difference > 0.0;
  const auto variety = [](const TrainedSensors& seen) {
    return static_cast<double>(seen.max_rings) / seen.min_rings;
  };
  return variety(*model.trained_for) < variety(*other.trained_for);
}

ModelDescription for_sensor(ModelDescription model, const SensorModel& sensor,
                            const LidarTilt& tilt) {
  if (!model.follow_sensor) return model;
  model.fov_up = sensor.fov_up;
  model.fov_down = sensor.fov_down;
  model.rows = to_multiple(image_rows(sensor, model.rows) * growth_of_rows(model, tilt));
  if (sensor.rings <= few_beams) model.columns = std::min(model.columns, columns_of_few_beams);
  return model;
}

}  // namespace stillmap
