#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/simulation/city_plan.hpp"
#include "core/simulation/lidar_flaws.hpp"
#include "core/simulation/materials.hpp"

namespace stillmap::simulation {

/// How the lidar moves on top of the vehicle that carries it.
enum class LidarMotion {
  /// Fixed to the vehicle.
  vehicle,
  /// A robot that turns on the spot: quarter turns at 55 degrees a second, which begin and end
  /// within a tenth of a second.
  hard_turns,
  /// In a hand, or on a walking robot: steps, sway, and glances to the sides.
  handheld,
};

/// Motion of that name ("vehicle", "hard_turns", "handheld").
/// @throws std::invalid_argument with the names that exist.
[[nodiscard]] LidarMotion lidar_motion(const std::string& name);

struct SimulationConfig {
  CityPlan plan = quiet_city();
  /// Determines city and traffic.
  std::uint64_t seed = 1;
  /// Another day in the same city: other traffic, other parked vehicles, other noise.
  std::uint64_t day = 0;
  SensorModel sensor = hdl_64e();
  /// Length of the sequence, one scan every `sensor.period_s`.
  int scans = 400;
  /// Firings of each beam in a revolution; 0: the sensor's at 10 Hz.
  int firings = 0;
  /// True: lidar and traffic move during a revolution and every point has its time. False: all
  /// points are measured at the stamp.
  bool rolling = false;
  LidarMotion motion = LidarMotion::vehicle;
  double lidar_height_m = 1.73;
  /// Where the lidar sits on the vehicle, instead of upright at that height. Base is on the ground.
  std::optional<Eigen::Isometry3d> T_base_lidar;
  BeamNoise noise;
  LidarFlaws flaws;
  Materials materials = default_materials();

  /// Seed of all that changes from day to day; that of the city on day 0.
  [[nodiscard]] std::uint64_t day_seed() const;
  /// All faults, one a line; empty when the configuration is valid.
  [[nodiscard]] std::string faults() const;
};

/// A scan with ground truth.
struct SimulatedScan {
  /// Ring after ring from the highest, each anticlockwise from straight ahead. Labels are those
  /// of `raw_labels`, reduced to the network's classes. With `rolling`, points are in the lidar's
  /// frame at their own time, else at the stamp.
  Scan scan;
  /// SemanticKITTI: class id (252..259: moving) in the low 16 bits, instance id in the high ones.
  std::vector<std::uint32_t> raw_labels;
  /// True pose of the lidar at the stamp.
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  std::int64_t stamp_ns = 0;
};

/// A lidar sequence in a synthetic city. Deterministic: the same configuration gives the same bits,
/// in any order and on any number of threads. `scan` is thread-safe.
class Simulation {
 public:
  /// @throws std::invalid_argument with all faults of the configuration.
  explicit Simulation(SimulationConfig config);
  ~Simulation();

  [[nodiscard]] const SimulationConfig& config() const;
  /// @pre 0 <= index < config().scans
  [[nodiscard]] SimulatedScan scan(int index) const;
  /// True pose of the lidar, `time_s` after the first scan's stamp.
  [[nodiscard]] Eigen::Isometry3d T_map_lidar_at(double time_s) const;

 private:
  struct World;
  std::unique_ptr<World> world_;
};

}  // namespace stillmap::simulation
