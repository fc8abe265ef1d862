#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>

#include "clients/commands/arguments/simulation_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "config/loaders/sensor_file.hpp"
#include "core/dataset/gnss_file.hpp"
#include "core/dataset/imu_file.hpp"
#include "core/dataset/kitti_files.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/simulation/simulated_gnss.hpp"
#include "core/simulation/simulated_imu.hpp"

namespace stillmap::cli {
namespace {

struct SimulateArguments {
  std::string out;
  SimulationArguments simulation;
  bool imu = false;
  /// Wander of the receiver [m]; 0: none.
  double gnss_m = 0.0;
  /// So much later than it was there are its stamps [s].
  double gnss_delay_s = 0.0;
  bool json = false;
};

struct Written {
  int scans = 0;
  std::uint64_t points = 0;
};

Written write_sequence(const SimulateArguments& arguments, const simulation::Simulation& simulation,
                       StopSignal& stop) {
  const std::filesystem::path folder = arguments.out;
  KittiSequenceWriter writer(folder);
  // Before the scans, so that they are there however the run ends.
  const Eigen::Isometry3d T_city_first = simulation.T_map_lidar_at(0.0);
  write_poses(folder / "first_pose_city.txt", {&T_city_first, 1});
  save_sensor(simulation.config().sensor, folder / "sensor.yaml");
  if (arguments.imu) write_imu_csv(folder / "imu.csv", simulated_imu(simulation));
  if (arguments.gnss_m > 0.0) {
    const simulation::GnssErrors errors{.wander_m = arguments.gnss_m,
                                        .delay_s = arguments.gnss_delay_s};
    write_gnss_csv(folder / "gnss.csv", simulated_gnss(simulation, errors));
  }
  const int scans = simulation.config().scans;
  Progress progress("simulate", "scans", static_cast<std::uint64_t>(scans));
  Written written;
  while (written.scans < scans && !stop.requested()) {
    const simulation::SimulatedScan scan = simulation.scan(written.scans);
    writer.add(scan.scan, scan.raw_labels, scan.T_map_lidar);
    written.scans += 1;
    written.points += scan.scan.size();
    progress.update(static_cast<std::uint64_t>(written.scans));
  }
  writer.finish();
  return written;
}

/// Throws std::invalid_argument for one that stamps cannot have.
void check_gnss_delay(double delay_s) {
  constexpr double day_s = 86'400.0;
  // Written so that NaN fails.
  if (std::abs(delay_s) <= day_s) return;
  throw std::invalid_argument("--gnss-delay must be a number of seconds, a day at most");
}

ExitCode run(const SimulateArguments& arguments) {
  StopSignal stop;
  check_gnss_delay(arguments.gnss_delay_s);
  const simulation::SimulationConfig config = simulation_config(arguments.simulation);
  const simulation::Simulation simulation(config);
  const Written written = write_sequence(arguments, simulation, stop);
  if (arguments.json) {
    std::cout << Json{{"folder", arguments.out},
                      {"city", config.plan.name},
                      {"sensor", config.sensor.name},
                      {"seed", config.seed},
                      {"day", config.day},
                      {"scans", written.scans},
                      {"points", written.points},
                      {"rolling", config.rolling},
                      {"motion", arguments.simulation.motion}}
                     .dump(2)
              << "\n";
  } else {
    std::cout << written.scans << " scans, " << written.points << " points of a "
              << config.sensor.name << " in city '" << config.plan.name << "', seed " << config.seed
              << ": " << arguments.out
              << "/ (SemanticKITTI sequence; poses.txt is in the camera frame, as "
              << "KITTI's)\n";
  }
  if (written.scans == config.scans) return ExitCode::ok;
  std::cerr << "stillmap: stopped early, as asked, after " << written.scans << " of "
            << config.scans << " scans; " << arguments.out
            << " is a sequence of these, complete in itself\n";
  return ExitCode::failed;
}

/// Options for what is written beside the scans.
void add_recorded_beside(CommandHandle command, SimulateArguments& arguments) {
  command.flag("--imu", arguments.imu,
               "Write imu.csv, too: an IMU at the lidar, 200 Hz, with noise and bias");
  const OptionHandle gnss =
      command
          .option("--gnss", arguments.gnss_m,
                  "Write gnss.csv, too: an antenna at the lidar, 5 Hz, that errs by so many metres "
                  "for a minute, and by more beside houses (0.02: with corrections, 1.5: without)")
          .above_zero();
  command
      .option(
          "--gnss-delay", arguments.gnss_delay_s,
          "Its stamps are so many seconds late, as of a receiver that stamps what it sends when "
          "it sends it (0.1), or that has GPS time (18)")
      .with_default()
      .needs(gnss);
}

}  // namespace

void add_simulate_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<SimulateArguments>();
  SimulationArguments& simulation = arguments->simulation;
  CommandHandle command = program.command(
      "simulate", "Make a sequence in a simulated city, with labels and true poses");
  command.option("OUT", arguments->out, "New folder for the sequence").required();
  command
      .option("--preset", simulation.preset,
              "City: quiet, crowd, yard (one small block), circuit (a route that comes back to "
              "every street, in both directions) or any (streets, houses, plants, traffic, "
              "materials and the lidar's flaws drawn by the seed, as for training)")
      .with_default();
  command
      .option("--traffic", simulation.traffic,
              "Factor on everything that moves in the preset's city; 0: nothing does")
      .zero_to(10)
      .with_default();
  command
      .option("--sensor", simulation.sensor,
              "hdl_64e (hdl64), hdl_32e, vlp_16 (vlp16) or a sensor file")
      .with_default();
  command.option("--seed", simulation.seed, "Another seed is another city and other traffic")
      .with_default();
  command
      .option("--day", simulation.day,
              "Another day in the same city: other traffic, other parked vehicles")
      .with_default();
  command.option("--scans", simulation.scans, "Scans to write, ten a second of driving")
      .above_zero()
      .with_default();
  command.flag("--rolling", simulation.rolling,
               "The lidar moves while it turns; every point has its time");
  command
      .option("--motion", simulation.motion,
              "Of the lidar on its vehicle: vehicle (fixed), hard_turns (a robot that turns on the "
              "spot at 55 degrees a second) or handheld")
      .with_default();
  add_mount_option(command, simulation.mount,
                   "Not upright above the middle of its vehicle, but there");
  add_recorded_beside(command, *arguments);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap simulate city --scans 300\n"
      "  stillmap simulate avenue --preset crowd --seed 7 --sensor vlp_16\n"
      "  stillmap simulate empty --traffic 0 --scans 50 --rolling\n"
      "poses.txt begins at the first scan, as KITTI's do; first_pose_city.txt has the pose of its\n"
      "lidar in the city, in which all days are. sensor.yaml is the lidar, for training.\n"
      "The same options give the same files, bit by bit.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
