#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <iostream>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/evaluate/drive_run.hpp"
#include "clients/commands/evaluate/ground_truth_sequence.hpp"
#include "clients/commands/mapping/sample_feed.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/model_file.hpp"
#include "config/loaders/server_config.hpp"
#include "core/evaluation/drive_mutation.hpp"
#include "core/lidar/angle_units.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap::cli {
namespace {

struct EvaluateDrivesArguments {
  std::vector<std::string> drives;
  std::vector<std::string> weightings{"semantic"};
  std::size_t scans = 100'000;
  std::size_t start = 0;
  std::string labels = "files";
  std::string stamps = "as_recorded";
  std::string imu = "as_recorded";
  std::string mutation = "none";
  std::string other_place;
  MapperArguments mapper;
  bool each = false;
  bool json = false;
};

constexpr const char* drives_explanation =
    "Examples:\n"
    "  stillmap evaluate drives sim:crowd,seed=2,motion=hard_turns --weightings none semantic\n"
    "  stillmap evaluate drives sim:quiet,rolling,scans=100 --mutate teleport\n"
    "A pose is wrong when the motion since the last right one is off by more than 0.2 m and 2 % of "
    "the path, or 1 deg and 0.02 deg a metre, or since that 20 m back by more than 5 % of the path "
    "(less than 20 m on: by 1 m since the first one).\n"
    "Column 'wrong good': wrong poses called good; 'right lost': right ones called lost; ms: a "
    "scan without the time for labels, map included. --labels model takes the lidar to be upright.";

/// Wrong labels: a share of the points at random, or all of a class.
void spoil_labels(Scan& scan, const std::string& how, std::size_t index) {
  if (scan.labels.empty() || how == "files") return;
  if (how == "none" || how == "model") {
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

/// Another convention of the points' times; the trajectory must not change. Returns how much later
/// the stamp is [s].
double restamp(Scan& scan, const std::string& how, double period_s) {
  if (scan.time_offset_s.empty() || how == "as_recorded") return 0.0;
  if (how == "removed") {
    scan.time_offset_s.clear();
    return 0.0;
  }
  const double shift_s = how == "middle" ? 0.5 * period_s : how == "end" ? period_s : 0.0;
  scan.stamp_ns += std::llround(shift_s * 1e9);
  for (float& offset : scan.time_offset_s) offset -= static_cast<float>(shift_s);
  return shift_s;
}

/// Faults of an IMU.
std::vector<ImuSample> spoilt(std::vector<ImuSample> samples, const std::string& how) {
  if (how == "none") return {};
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(0.5 * std::numbers::pi, Eigen::Vector3d(1.0, 1.0, 1.0).normalized())
          .matrix();
  const std::size_t breaks = samples.size() / 3;
  if (how == "stops") samples.resize(breaks);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    ImuSample& sample = samples[k];
    if (how == "deg_per_s") sample.angular_velocity_imu *= deg_per_rad;
    if (how == "turned") sample.angular_velocity_imu = turned * sample.angular_velocity_imu;
    if (how == "late") sample.stamp_ns += 20'000'000;
    if (how == "frozen" && k > breaks) {
      sample.angular_velocity_imu = samples[breaks].angular_velocity_imu;
      sample.acceleration_imu = samples[breaks].acceleration_imu;
    }
  }
  return samples;
}

void print_imu(const DriveRun& run) {
  const InertialTracker& tracker = run.inertial();
  if (!tracker.has_samples()) return;
  std::cerr << run.weighting() << " imu: helped " << tracker.counts().scans_helped
            << " scans, trust lost " << tracker.counts().trust_losses << " times, bias "
            << tracker.calibration().bias_imu().transpose() << " rad/s, late by "
            << 1e3 * tracker.calibration().time_offset_s() << " ms\n";
}

/// A drive as the mappers get it.
struct MutatedDrive {
  GroundTruthSequence sequence;
  std::optional<GroundTruthSequence> other_place;
  std::vector<evaluation::MutatedScan> scans;

  /// Where the lidar was `later_s` after the stamp of the scan, on the way to the next one.
  [[nodiscard]] std::optional<Eigen::Isometry3d> truth(const evaluation::MutatedScan& scan,
                                                       double later_s) const {
    if (scan.of_other_place || sequence.truth.empty()) return std::nullopt;
    const Eigen::Isometry3d& T_world_lidar = sequence.truth.at(scan.index);
    if (later_s == 0.0 || sequence.truth.size() < 2) return T_world_lidar;
    // The last one goes on as it came.
    const std::size_t from = std::min(scan.index, sequence.truth.size() - 2);
    const double interval_s =
        1e-9 * static_cast<double>(sequence.stamps_ns[from + 1] - sequence.stamps_ns[from]);
    if (!(interval_s > 0.0)) return T_world_lidar;
    const Eigen::Isometry3d T_step = sequence.truth[from].inverse() * sequence.truth[from + 1];
    return T_world_lidar * scaled_motion(T_step, later_s / interval_s);
  }
};

MutatedDrive open_drive(const std::string& name, const EvaluateDrivesArguments& arguments) {
  const evaluation::DriveMutation mutation = evaluation::drive_mutation(arguments.mutation);
  MutatedDrive drive{.sequence = open_ground_truth_sequence(name), .other_place = {}, .scans = {}};
  if (mutation == evaluation::DriveMutation::other_place)
    drive.other_place = arguments.other_place.empty()
                            ? open_other_city(name)
                            : open_ground_truth_sequence(arguments.other_place);
  const std::vector<std::int64_t>& stamps_ns = drive.sequence.stamps_ns;
  const std::size_t start = std::min(arguments.start, stamps_ns.size());
  const std::size_t count = std::min(arguments.scans, stamps_ns.size() - start);
  drive.scans =
      evaluation::mutate_drive(mutation, std::span(stamps_ns).subspan(start, count),
                               drive.other_place ? drive.other_place->size() : std::size_t{0});
  for (evaluation::MutatedScan& scan : drive.scans)
    if (!scan.of_other_place) scan.index += start;
  return drive;
}

std::shared_ptr<SharedLabels> labels_of(const GroundTruthSequence& sequence,
                                        const SensorModel& sensor,
                                        const EvaluateDrivesArguments& arguments) {
  if (arguments.labels != "model") {
    if (!sequence.labelled || arguments.labels == "none")
      return std::make_shared<SharedLabels>(std::make_unique<NullSegmenter>());
    return std::make_shared<SharedLabels>(std::make_unique<PassthroughSegmenter>());
  }
  LabelsConfig labels;
  if (!arguments.mapper.config_file.empty())
    labels = load_server_config(arguments.mapper.config_file).labels;
  labels.source = LabelProvider::model;
  return std::make_shared<SharedLabels>(open_segmenter(labels, sensor));
}

/// A line of --each: what became of a scan.
void print_scan(std::size_t scan, const DriveRun& run, const OdometryResult* found) {
  std::cerr << scan << " " << run.weighting() << " "
            << (found != nullptr ? name(found->health) : "rejected");
  if (found != nullptr)
    std::cerr << " " << run.last_error() << "; it " << found->iterations << " e "
              << found->edge_correspondences << " p " << found->plane_correspondences << " rms "
              << found->rms_residual_m << " fit " << found->fit << " upright " << found->upright_fit
              << " overlap " << found->overlap << " points off by "
              << found->point_deviation_m.transpose() << " m, sigma "
              << std::sqrt(found->covariance.diagonal().head<2>().maxCoeff()) << " m";
  std::cerr << "\n";
}

/// All weightings on the same scans. `scan_done(seen)` returning false ends it early.
std::vector<DriveResult> run_drive(const MutatedDrive& drive,
                                   const EvaluateDrivesArguments& arguments,
                                   const std::function<bool(std::size_t)>& scan_done) {
  const MapperConfig config = mapper_config(arguments.mapper, drive.sequence.sensor);
  const auto labels = labels_of(drive.sequence, config.sensor, arguments);
  std::deque<DriveRun> runs;
  for (const std::string& weighting : arguments.weightings)
    runs.emplace_back(weighting, config, std::make_unique<SharedSegmenter>(labels));
  SampleFeed<ImuSample> imu(spoilt(drive.sequence.imu, arguments.imu));
  std::size_t seen = 0;
  for (const evaluation::MutatedScan& mutated : drive.scans) {
    const GroundTruthSequence& source =
        mutated.of_other_place ? *drive.other_place : drive.sequence;
    Scan scan = evaluation::mutate_scan(source.read(mutated.index), mutated);
    spoil_labels(scan, arguments.labels, mutated.index);
    const double later_s = restamp(scan, arguments.stamps, config.sensor.period_s);
    labels->next_scan();
    for (const ImuSample& sample : imu.take_up_to_end_of(scan, config.sensor.period_s))
      for (DriveRun& run : runs) run.add(sample);
    for (std::size_t k = 0; k < runs.size(); ++k) {
      // In turn: the first one of a scan finds the caches cold.
      DriveRun& run = runs[(seen + k) % runs.size()];
      const OdometryResult* found = run.map(scan, drive.truth(mutated, later_s));
      if (arguments.each) print_scan(seen, run, found);
    }
    if (!scan_done(++seen)) break;
  }
  std::vector<DriveResult> results;
  for (DriveRun& run : runs) {
    if (arguments.each) print_imu(run);
    results.push_back(run.result());
  }
  return results;
}

std::vector<std::string> row_of(const std::string& drive, const DriveResult& result) {
  std::vector<std::string> row{drive, result.weighting};
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
  for (const OdometryHealth health :
       {OdometryHealth::good, OdometryHealth::degenerate, OdometryHealth::lost})
    row.push_back(std::to_string(result.count(health)));
  row.push_back(std::to_string(result.rejected));
  if (result.score) {
    row.insert(row.end(), {std::to_string(result.score->wrong),
                           std::to_string(result.score->wrong_called_good.size()),
                           std::to_string(result.score->right_called_bad.size())});
  } else {
    row.insert(row.end(), 3, "-");
  }
  row.insert(row.end(), {std::to_string(result.voxels), fixed(result.duration.quantile(0.5), 1),
                         fixed(result.duration.quantile(0.99), 1)});
  return row;
}

Json json_of(const MutatedDrive& drive, const EvaluateDrivesArguments& arguments,
             const DriveResult& result) {
  Json row = to_json(result);
  row.set("drive", drive.sequence.name);
  row.set("sensor", drive.sequence.sensor.name);
  row.set("labels", arguments.labels);
  row.set("stamps", arguments.stamps);
  row.set("mutation", arguments.mutation);
  return row;
}

ExitCode run(const EvaluateDrivesArguments& arguments) {
  StopSignal stop;
  if (!arguments.other_place.empty() && arguments.mutation != "other_place")
    throw std::invalid_argument("--other-place needs --mutate other_place");
  Table table({"drive", "weighting", "path m", "t_err %", "deg/100m", "ATE m", "cm a scan", "worst",
               "good", "degenerate", "lost", "rejected", "wrong", "wrong good", "right lost",
               "voxels", "ms", "p99"});
  Json rows = Json::array();
  for (const std::string& name : arguments.drives) {
    const MutatedDrive drive = open_drive(name, arguments);
    Progress progress(name, "scans", drive.scans.size());
    const auto scan_done = [&](std::size_t scans) {
      progress.update(scans);
      return !stop.requested();
    };
    for (const DriveResult& result : run_drive(drive, arguments, scan_done)) {
      table.add(row_of(drive.sequence.name, result));
      rows.push_back(json_of(drive, arguments, result));
    }
    if (stop.requested()) break;
  }
  std::cout << (arguments.json ? rows.dump(2) + "\n" : table.text());
  if (!stop.requested()) return ExitCode::ok;
  std::cerr << "stillmap: stopped early, as asked: the last drive is of its first scans alone, and "
               "drives after it are missing\n";
  return ExitCode::failed;
}

}  // namespace

void add_evaluate_drives_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<EvaluateDrivesArguments>();
  CommandHandle command = evaluate.command(
      "drives", "Odometry on many drives: errors, health, sharpness of the map, time");
  command
      .option("DRIVES", arguments->drives,
              "Sequences, or sim:PRESET (quiet, crowd, yard, circuit, "
              "any)[,seed=N][,scans=N][,sensor=S][,motion=M][,traffic=T]"
              "[,rolling][,imu]")
      .required();
  command
      .option("--weightings", arguments->weightings,
              "none, geometric, semantic: each on the same scans")
      .with_default();
  command.option("--scans", arguments->scans, "Take as many scans of each at most").above_zero();
  command.option("--start", arguments->start, "Number of the first scan");
  command
      .option("--labels", arguments->labels,
              "Those of the files, spoilt ones, none, or those of the network")
      .one_of(
          {"files", "none", "model", "random30", "no_movers", "buildings_move", "vegetation_moves"})
      .with_default();
  command
      .option("--stamps", arguments->stamps,
              "Where in the sweep the stamp is, or no times of points at all")
      .one_of({"as_recorded", "middle", "end", "removed"})
      .with_default();
  command.option("--imu", arguments->imu, "As recorded, none, or with a fault")
      .one_of({"as_recorded", "none", "deg_per_s", "turned", "late", "frozen", "stops"})
      .with_default();
  command
      .option("--mutate", arguments->mutation,
              "What goes wrong: a second and three are missing, the lidar is carried off, sees "
              "another place, half or all but 20 degrees of the view is covered, stamps are off")
      .one_of({"none", "drop", "teleport", "other_place", "cover", "cover_all", "jitter", "late"})
      .with_default();
  command.option("--other-place", arguments->other_place,
                 "The sequence for --mutate other_place; default: the same simulated drive in "
                 "another city");
  command.option("--config", arguments->mapper.config_file,
                 "Server file; its mapper settings are used");
  command.option("--sensor", arguments->mapper.sensor, "Of recorded sequences");
  command.flag("--each", arguments->each, "Print every scan's error to stderr");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(drives_explanation);
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
