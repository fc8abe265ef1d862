#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/arguments/simulation_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/mapping/imu_feed.hpp"
#include "clients/commands/mapping/trajectory_report.hpp"
#include "clients/commands/stage_stopwatch.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulated_imu.hpp"
#include "idl/bag/bag_scan_source.hpp"

namespace stillmap::cli {
namespace {

/// Scans with true poses, from disk or simulated on demand.
struct Drive {
  std::string name;
  std::size_t scans = 0;
  SensorModel sensor;
  bool labelled = false;
  std::function<Scan(std::size_t)> read;
  /// Poses of the lidar at the scans' stamps.
  std::vector<Eigen::Isometry3d> truth;
  std::vector<ImuSample> imu;
};

struct EvaluateDrivesArguments {
  std::vector<std::string> drives;
  std::vector<std::string> weightings{"semantic"};
  std::size_t scans = 100'000;
  std::size_t start = 0;
  std::string labels = "files";
  std::string stamps = "as_recorded";
  std::string imu = "as_recorded";
  MapperArguments mapper;
  bool each = false;
};

/// "sim:crowd,seed=2,sensor=vlp_16,motion=hard_turns,rolling,scans=300": a drive in words.
struct SimulatedDrive {
  SimulationArguments simulation;
  bool imu = false;
};

SimulatedDrive simulated_drive(const std::string& text) {
  SimulatedDrive drive;
  SimulationArguments& arguments = drive.simulation;
  std::istringstream words(text);
  std::getline(words, arguments.preset, ',');
  for (std::string word; std::getline(words, word, ',');) {
    const std::size_t equals = word.find('=');
    const std::string key = word.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
    if (key == "seed")
      arguments.seed = std::stoull(value);
    else if (key == "scans")
      arguments.scans = std::stoi(value);
    else if (key == "sensor")
      arguments.sensor = value;
    else if (key == "motion")
      arguments.motion = value;
    else if (key == "traffic")
      arguments.traffic = value;
    else if (word == "rolling")
      arguments.rolling = true;
    else if (word == "imu")
      drive.imu = true;
    else
      throw std::invalid_argument(
          "'" + word + "' in 'sim:" + text +
          "': there are seed=, scans=, sensor=, motion=, traffic=, rolling and imu");
  }
  return drive;
}

const std::string simulated_prefix = "sim:";

Drive open_simulated(const std::string& name) {
  const SimulatedDrive asked = simulated_drive(name.substr(simulated_prefix.size()));
  const simulation::SimulationConfig config = simulation_config(asked.simulation);
  const auto simulation = std::make_shared<simulation::Simulation>(config);
  Drive drive{
      .name = name,
      .scans = static_cast<std::size_t>(config.scans),
      .sensor = config.sensor,
      .labelled = true,
      .read = [simulation](std::size_t i) { return simulation->scan(static_cast<int>(i)).scan; },
      .truth = {},
      .imu = {}};
  if (asked.imu) {
    drive.imu = simulation::simulated_imu(*simulation);
    drive.sensor.imu = ImuMount{};
  }
  for (int i = 0; i < config.scans; ++i)
    drive.truth.push_back(simulation->T_map_lidar_at(i * config.sensor.period_s));
  return drive;
}

Drive open_recorded(const std::string& name) {
  const auto dataset = std::make_shared<ScanDataset>(dds::open_sequence(name));
  const std::optional<Trajectory> truth = dataset->truth();
  Drive drive{.name = name,
              .scans = dataset->size(),
              .sensor = dataset->suggested_sensor(),
              .labelled = dataset->has_labels(0),
              .read = [dataset](std::size_t i) { return dataset->read(i).scan; },
              .truth = {},
              .imu = dataset->imu()};
  if (truth)
    for (const StampedPose& pose : *truth) drive.truth.push_back(pose.T_map_lidar);
  return drive;
}

/// What became of a drive.
struct DriveResult {
  std::string weighting;
  std::optional<TrajectoryReport> report;
  std::map<OdometryHealth, std::size_t> health;
  std::size_t rejected = 0;
  std::size_t voxels = 0;
  double median_ms = 0.0;
  /// Of the longest scan.
  double max_ms = 0.0;
};

/// Wrong labels: a share of the points at random, or all of a class.
void spoil_labels(Scan& scan, const std::string& how, std::size_t index) {
  if (scan.labels.empty() || how == "files") return;
  if (how == "none") {
    scan.labels.clear();
    return;
  }
  constexpr int classes = 20;
  std::mt19937 random(static_cast<std::uint32_t>(index));
  for (SemanticClass& label : scan.labels) {
    if (how == "random30" && random() % 10 < 3)
      label = static_cast<SemanticClass>(1 + random() % (classes - 1));
    if (how == "no_movers" && is_movable(label)) label = SemanticClass::building;
    if (how == "buildings_move" && label == SemanticClass::building) label = SemanticClass::car;
    if (how == "vegetation_moves" && label == SemanticClass::vegetation)
      label = SemanticClass::truck;
  }
}

/// Another convention of the points' times; the trajectory must not change.
void restamp(Scan& scan, const std::string& how, double period_s) {
  if (scan.time_offset_s.empty() || how == "as_recorded") return;
  if (how == "removed") {
    scan.time_offset_s.clear();
    return;
  }
  const double shift_s = how == "middle" ? 0.5 * period_s : how == "end" ? period_s : 0.0;
  scan.stamp_ns += std::llround(shift_s * 1e9);
  for (float& offset : scan.time_offset_s) offset -= static_cast<float>(shift_s);
}

/// Faults of an IMU.
std::vector<ImuSample> spoilt(std::vector<ImuSample> samples, const std::string& how) {
  if (how == "none") return {};
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.5 * M_PI, Eigen::Vector3d(1.0, 1.0, 1.0).normalized()).matrix();
  for (std::size_t k = 0; k < samples.size(); ++k) {
    ImuSample& sample = samples[k];
    if (how == "deg_per_s") sample.angular_velocity_imu *= 180.0 / M_PI;
    if (how == "turned") sample.angular_velocity_imu = turned * sample.angular_velocity_imu;
    if (how == "late") sample.stamp_ns += 20'000'000;
    const std::size_t breaks = samples.size() / 3;
    if (how == "frozen" && k > breaks) {
      sample.angular_velocity_imu = samples[breaks].angular_velocity_imu;
      sample.acceleration_imu = samples[breaks].acceleration_imu;
    }
    if (how == "stops" && k > breaks) {
      samples.resize(k);
      break;
    }
  }
  return samples;
}

DriveResult run_drive(const Drive& drive, const std::string& weighting,
                      const EvaluateDrivesArguments& arguments,
                      const std::function<bool(std::size_t)>& scan_done) {
  MapperConfig config = mapper_config(arguments.mapper, drive.sensor);
  config.odometry.weighting = weighting_from_name(weighting);
  Mapper mapper(config, drive.labelled
                            ? std::unique_ptr<Segmenter>(std::make_unique<PassthroughSegmenter>())
                            : std::make_unique<NullSegmenter>());
  ImuFeed imu(spoilt(drive.imu, arguments.imu));
  DriveResult result{.weighting = weighting, .report = {}, .health = {}};
  evaluation::PosePairs pairs;
  StageStopwatch times;
  const std::size_t end = std::min(drive.scans, arguments.start + arguments.scans);
  for (std::size_t i = arguments.start; i < end; ++i) {
    Scan scan = drive.read(i);
    spoil_labels(scan, arguments.labels, i);
    restamp(scan, arguments.stamps, config.sensor.period_s);
    for (const ImuSample& sample : imu.take_up_to_end_of(scan, config.sensor.period_s))
      mapper.add(sample);
    times.begin();
    const std::optional<MappedScan> mapped = mapper.process(std::move(scan));
    times.end();
    if (!mapped) {
      ++result.rejected;
      continue;
    }
    ++result.health[mapped->odometry.health];
    if (!drive.truth.empty()) {
      pairs.truth.push_back(drive.truth.at(i));
      pairs.estimate.push_back(mapped->odometry.T_map_lidar);
      if (arguments.each && pairs.size() > 1) {
        const std::size_t n = pairs.size() - 1;
        const Eigen::Isometry3d dt = pairs.truth[n - 1].inverse() * pairs.truth[n];
        const Eigen::Isometry3d de = pairs.estimate[n - 1].inverse() * pairs.estimate[n];
        const Eigen::Isometry3d e = dt.inverse() * de;
        std::cerr << i << " " << name(mapped->odometry.health) << " step "
                  << dt.translation().norm() << " m " << evaluation::rotation_angle(dt) * 57.2958
                  << " deg, error " << e.translation().norm() * 100 << " cm "
                  << evaluation::rotation_angle(e) * 57.2958 << " deg; it "
                  << mapped->odometry.iterations << " e " << mapped->odometry.edge_correspondences
                  << " p " << mapped->odometry.plane_correspondences << " rms "
                  << mapped->odometry.rms_residual_m << "\n";
      }
    }
    if (!scan_done(i + 1 - arguments.start)) break;
  }
  if (arguments.each && mapper.inertial().has_samples()) {
    const InertialTracker& tracker = mapper.inertial();
    std::cerr << "imu: helped " << tracker.counts().scans_helped << " scans, trust lost "
              << tracker.counts().trust_losses << " times, bias "
              << tracker.calibration().bias_imu().transpose() << " rad/s, late by "
              << 1e3 * tracker.calibration().time_offset_s() << " ms\n";
  }
  for (const auto& tile : mapper.map_snapshot()->tiles) result.voxels += tile->voxels.size();
  result.median_ms = times.total().quantile(0.5);
  result.max_ms = times.total().quantile(1.0);
  if (pairs.size() > 1) result.report = report_trajectory(pairs);
  return result;
}

std::vector<std::string> row_of(const Drive& drive, const DriveResult& result) {
  const auto count = [&](OdometryHealth health) {
    const auto found = result.health.find(health);
    return std::to_string(found == result.health.end() ? 0 : found->second);
  };
  std::vector<std::string> row{drive.name, result.weighting};
  if (result.report) {
    const TrajectoryReport& r = *result.report;
    row.insert(
        row.end(),
        {fixed(r.path_m, 0), r.kitti ? fixed(r.kitti->translation_percent, 3) : "-",
         r.kitti ? fixed(r.kitti->rotation_deg_per_100m, 3) : "-", fixed(r.rigid_aligned.rmse_m, 3),
         r.relative ? fixed(100.0 * r.relative->mean_translation_m, 2) : "-",
         r.relative ? fixed(100.0 * r.relative->max_translation_m, 1) : "-"});
  } else {
    row.insert(row.end(), 6, "-");
  }
  row.insert(row.end(),
             {count(OdometryHealth::good), count(OdometryHealth::degenerate),
              count(OdometryHealth::lost), std::to_string(result.rejected),
              std::to_string(result.voxels), fixed(result.median_ms, 1), fixed(result.max_ms, 0)});
  return row;
}

ExitCode run(const EvaluateDrivesArguments& arguments) {
  StopSignal stop;
  Table table({"drive", "weighting", "path m", "t_err %", "deg/100m", "ATE m", "cm a scan", "worst",
               "good", "degenerate", "lost", "rejected", "voxels", "ms", "max"});
  for (const std::string& name : arguments.drives) {
    const Drive drive =
        name.starts_with(simulated_prefix) ? open_simulated(name) : open_recorded(name);
    for (const std::string& weighting : arguments.weightings) {
      Progress progress(name + " " + weighting, "scans", std::min(drive.scans, arguments.scans));
      const auto seen = [&](std::size_t scans) {
        progress.update(scans);
        return !stop.requested();
      };
      table.add(row_of(drive, run_drive(drive, weighting, arguments, seen)));
      if (stop.requested()) break;
    }
  }
  std::cout << table.text();
  return stop.requested() ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_evaluate_drives_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<EvaluateDrivesArguments>();
  CommandHandle command = evaluate.command(
      "drives", "Odometry on many drives: errors, health, sharpness of the map, time");
  command
      .option("DRIVES", arguments->drives,
              "Sequences, or sim:PRESET[,seed=N][,scans=N][,sensor=S][,motion=M][,rolling][,imu]")
      .required();
  command.option("--weightings", arguments->weightings, "none, geometric, semantic").with_default();
  command.option("--scans", arguments->scans, "Take as many scans of each at most").above_zero();
  command.option("--start", arguments->start, "Number of the first scan");
  command
      .option("--labels", arguments->labels,
              "files, none, random30, no_movers, buildings_move, vegetation_moves")
      .with_default();
  command.option("--stamps", arguments->stamps, "as_recorded, middle, end, removed").with_default();
  command
      .option("--imu", arguments->imu,
              "as_recorded, none, or with a fault: deg_per_s, turned, late, frozen, stops")
      .with_default();
  command.option("--config", arguments->mapper.config_file,
                 "Server file; its mapper settings are used");
  command.option("--sensor", arguments->mapper.sensor, "Of recorded sequences");
  command.flag("--each", arguments->each, "Print every scan's error to stderr");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
