#include "clients/commands/evaluate/ground_truth_sequence.hpp"

#include <charconv>
#include <cmath>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <type_traits>

#include "clients/commands/dataset/recording.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/simulation/simulated_imu.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap::cli {
namespace {

const std::string simulated_prefix = "sim:";
/// From a city's seed to that of another one.
constexpr std::uint64_t other_city_seeds = 1000;

/// Throws std::invalid_argument naming the word, KEY=VALUE.
template <typename Number>
Number number_of(const std::string& word, const std::string& value) {
  Number number{};
  const char* const end = value.data() + value.size();
  const auto [rest, fault] = std::from_chars(value.data(), end, number);
  if (fault == std::errc() && rest == end) return number;
  throw std::invalid_argument("'" + word + "' in a simulated drive: '" + value + "' is no " +
                              (std::is_integral_v<Number> ? "whole number" : "number"));
}

/// A simulated drive in words.
struct SimulatedDrive {
  SimulationArguments simulation;
  bool imu = false;
};

SimulatedDrive simulated_drive(const std::string& name, const SimulationArguments& defaults) {
  SimulatedDrive drive{.simulation = defaults};
  SimulationArguments& arguments = drive.simulation;
  std::istringstream words(name.substr(simulated_prefix.size()));
  std::getline(words, arguments.preset, ',');
  for (std::string word; std::getline(words, word, ',');) {
    const std::size_t equals = word.find('=');
    const std::string key = word.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
    if (key == "seed")
      arguments.seed = number_of<std::uint64_t>(word, value);
    else if (key == "scans")
      arguments.scans = number_of<int>(word, value);
    else if (key == "sensor")
      arguments.sensor = value;
    else if (key == "motion")
      arguments.motion = value;
    else if (key == "traffic")
      arguments.traffic = number_of<double>(word, value);
    else if (word == "rolling")
      arguments.rolling = true;
    else if (word == "imu")
      drive.imu = true;
    else
      throw std::invalid_argument(
          "'" + word + "' in '" + name +
          "': there are seed=, scans=, sensor=, motion=, traffic=, rolling and imu");
  }
  return drive;
}

GroundTruthSequence open_simulated(const SimulatedDrive& drive) {
  const simulation::SimulationConfig config = simulation_config(drive.simulation);
  const auto simulation = std::make_shared<simulation::Simulation>(config);
  GroundTruthSequence sequence;
  sequence.sensor = config.sensor;
  sequence.labelled = true;
  if (drive.imu) {
    sequence.imu = simulation::simulated_imu(*simulation);
    sequence.sensor.imu = ImuMount{};
  }
  sequence.read = [simulation](std::size_t i) {
    return simulation->scan(static_cast<int>(i)).scan;
  };
  for (int i = 0; i < config.scans; ++i) {
    const double time_s = i * config.sensor.period_s;
    sequence.stamps_ns.push_back(std::llround(1e9 * time_s));
    sequence.truth.push_back(simulation->T_map_lidar_at(time_s));
  }
  return sequence;
}

GroundTruthSequence open_recorded(const std::string& name) {
  const auto dataset = std::make_shared<ScanDataset>(name);
  dataset->join_turns();
  GroundTruthSequence sequence;
  sequence.name = name;
  sequence.sensor = dataset->suggested_sensor();
  require_semantic_kitti_labels(*dataset);
  sequence.labelled = dataset->has_labels();
  sequence.imu = dataset->imu();
  sequence.read = [dataset](std::size_t i) { return dataset->read(i).scan; };
  for (std::size_t i = 0; i < dataset->size(); ++i)
    sequence.stamps_ns.push_back(dataset->stamp_ns(i));
  if (const std::optional<Trajectory> truth = dataset->truth())
    for (const StampedPose& pose : *truth) sequence.truth.push_back(pose.T_map_lidar);
  return sequence;
}

}  // namespace

GroundTruthSequence open_ground_truth_sequence(const std::string& name,
                                               const SimulationArguments& simulated) {
  if (!name.starts_with(simulated_prefix)) return open_recorded(name);
  const SimulatedDrive drive = simulated_drive(name, simulated);
  GroundTruthSequence sequence = open_simulated(drive);
  sequence.name = name;
  if (name.find(",seed=") == std::string::npos)
    sequence.name += ",seed=" + std::to_string(drive.simulation.seed);
  return sequence;
}

GroundTruthSequence open_other_city(const std::string& name) {
  if (!name.starts_with(simulated_prefix))
    throw std::invalid_argument("there is no other place for the recording " + name +
                                ": name one with --other-place");
  SimulatedDrive drive = simulated_drive(name, {});
  drive.simulation.seed += other_city_seeds;
  GroundTruthSequence sequence = open_simulated(drive);
  sequence.name = name + ",seed=" + std::to_string(drive.simulation.seed);
  return sequence;
}

}  // namespace stillmap::cli
