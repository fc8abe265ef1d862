#include <algorithm>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

#include "clients/commands/command.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/sensor_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/elevation_calibration.hpp"
#include "core/lidar/angle_units.hpp"
#include "core/lidar/sensor_fit.hpp"

namespace stillmap::cli {
namespace {

/// Fewer scans show too little of a place from elsewhere.
constexpr int min_calibration_scans = 20;

struct DatasetSensorArguments {
  std::string dataset;
  std::string topic;
  std::string out;
  bool calibrates = false;
  int scans = 100;
};

/// Finds the sensor's offset of elevation and says what was found.
void calibrate(const ScanDataset& recording, int max_scans, SensorModel& sensor) {
  const std::size_t scans = std::min(static_cast<std::size_t>(max_scans), recording.size());
  if (scans < std::size_t{min_calibration_scans}) {
    throw std::invalid_argument("--calibrate needs a drive of " +
                                std::to_string(min_calibration_scans) + " scans or more, not of " +
                                std::to_string(scans));
  }
  MapperConfig mapper;
  mapper.sensor = sensor;
  mapper.prepare.min_range_m = sensor.min_range_m;
  mapper.prepare.max_range_m = sensor.max_range_m;
  mapper.odometry.weighting = Weighting::none;
  const ElevationCalibrationConfig config;
  Progress progress("calibrate", "scans", config.trials() * scans);
  std::size_t driven = 0;
  const ElevationCalibration found = calibrate_elevation(
      mapper, scans,
      [&](std::size_t k) {
        progress.update(++driven);
        return recording.read(k).scan;
      },
      config);
  Table table({"turned up by [deg]", "occupied voxels"});
  for (const ElevationCalibration::Trial& trial : found.trials)
    table.add({fixed(trial.offset / rad_per_deg, 2), std::to_string(trial.voxels)});
  std::cout << table.text();
  if (!found.offset) {
    std::cout << "elevation offset: not to be told from this drive; it needs places that are seen "
                 "from near and far\n";
    return;
  }
  sensor.elevation_offset = *found.offset;
  std::cout << "elevation offset: " << fixed(*found.offset / rad_per_deg, 3)
            << " degrees (1 sigma: " << fixed(found.sigma / rad_per_deg, 3) << "), which saves "
            << fixed(100.0 * found.saving, 2) << " % of the voxels\n";
}

/// Whether the scan can be read and has a point that is anywhere.
bool has_points(const ScanDataset& recording, std::size_t index) {
  try {
    return std::ranges::any_of(recording.read(index).scan.points_lidar,
                               [](const Eigen::Vector3f& point) { return point.allFinite(); });
  } catch (const DatasetError&) {
    return false;
  }
}

/// A sensor of which nothing is seen would be named all the same.
void require_points(const ScanDataset& recording, const std::string& path) {
  for (std::size_t i = 0; i < recording.size(); ++i) {
    if (has_points(recording, i)) return;
  }
  throw DatasetError(path,
                     "has no scan with a finite point, and so shows no sensor; give a recording "
                     "with points");
}

ExitCode run(const DatasetSensorArguments& arguments) {
  end_cleanly_when_stopped();
  const ScanDataset recording = open_recording(arguments.dataset, arguments.topic);
  require_points(recording, arguments.dataset);
  SensorModel sensor = recording.suggested_sensor();
  std::cout << in_words(sensor) << "\n";
  if (arguments.calibrates) calibrate(recording, arguments.scans, sensor);
  if (!arguments.out.empty()) {
    save_sensor(sensor, arguments.out);
    std::cout << "written to " << arguments.out << ": name it as 'sensor' in the server's file\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_dataset_sensor_command(CommandHandle dataset, Action& action) {
  auto arguments = std::make_shared<DatasetSensorArguments>();
  CommandHandle command = dataset.command("sensor", "Find out which sensor recorded a data set");
  command.option("DATASET", arguments->dataset, dataset_kinds).required();
  command.option("--topic-in", arguments->topic, topic_in_help);
  command.option("--out,--output,-o", arguments->out, "Write a sensor file (YAML) for the server");
  const OptionHandle calibrate =
      command.flag("--calibrate", arguments->calibrates,
                   "Find by how much the vertical angles are off, by driving several times");
  command.option("--scans", arguments->scans, "Scans to calibrate by")
      .between(min_calibration_scans, 10000)
      .with_default()
      .needs(calibrate);
  command.explain(
      "Examples:\n"
      "  stillmap dataset sensor bag --out my_lidar.yaml\n"
      "  stillmap dataset sensor bag --calibrate --out my_lidar.yaml\n"
      "Reads a scan of usual size: the elevations of its rings, numbered or shown by its points, "
      "or where it shows none, the field of view that they fill, in 40 bands. Check the ranges in "
      "the file against the sensor's data sheet.\n"
      "--calibrate drives the first scans once for each of some offsets of elevation, and takes "
      "the one with which the map has fewest occupied voxels: vertical angles that are off bend "
      "what is seen from farther away. It wants a drive of some 50 m, the sensor's file gets the "
      "offset.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
