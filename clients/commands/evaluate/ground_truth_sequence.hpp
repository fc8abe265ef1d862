#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "clients/commands/arguments/simulation_arguments.hpp"
#include "core/inertial/imu_sample.hpp"
#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap::cli {

/// Scans with their truth, from disk or simulated on demand.
struct GroundTruthSequence {
  std::string name;
  SensorModel sensor;
  /// The scans have labels.
  bool labelled = false;
  /// Throws DatasetError when a file of the scan is damaged.
  std::function<Scan(std::size_t)> read;
  std::vector<std::int64_t> stamps_ns;
  /// True pose of the lidar at each scan's stamp; empty where it is not known.
  std::vector<Eigen::Isometry3d> truth;
  /// Of an IMU beside the lidar, where there was one.
  std::vector<ImuSample> imu;

  [[nodiscard]] std::size_t size() const { return stamps_ns.size(); }
};

/// Opens a sequence, or a simulated one: "sim:crowd,seed=2,sensor=vlp_16,motion=hard_turns,rolling,
/// imu,scans=300" (also traffic=). What the words do not say is as in `simulated`; their preset
/// comes first. Throws DatasetError, ConfigError or std::invalid_argument.
[[nodiscard]] GroundTruthSequence open_ground_truth_sequence(
    const std::string& name, const SimulationArguments& simulated = {});

/// The same drive in another simulated city. Throws std::invalid_argument for a recording, which
/// has no other.
[[nodiscard]] GroundTruthSequence open_other_city(const std::string& name);

}  // namespace stillmap::cli
