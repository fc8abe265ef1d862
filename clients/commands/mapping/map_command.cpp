#include <charconv>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/commands/mapping/earlier_map.hpp"
#include "clients/commands/mapping/map_output_folder.hpp"
#include "clients/commands/mapping/map_report.hpp"
#include "clients/commands/mapping/mapping_run.hpp"
#include "clients/commands/mapping/pose_files.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "config/loaders/server_config.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/frames/rigid_motion.hpp"
#include "core/map/map_id.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_sessions.hpp"
#include "core/map/tools/map_export.hpp"
#include "core/picture/map_picture.hpp"
#include "idl/bag/bag.hpp"

namespace stillmap::cli {
namespace {

/// A map needs no true poses: where those of the data set are a camera's, and it is not known where
/// the camera is, they are left out, and that is said.
std::optional<Trajectory> usable_truth(const ScanDataset& dataset) {
  try {
    return dataset.truth();
  } catch (const CameraUnknownError& error) {
    std::cerr << "stillmap: without accuracy, since the true poses cannot be used: " << error.what()
              << "\n";
    return std::nullopt;
  }
}

// True poses of the body at the mapped scans, in its frame at the first of them. `all`: the
// lidar's, one a scan.
std::optional<Trajectory> truth_of(const std::optional<Trajectory>& all,
                                   const MappingResult& result, const MappedBody& body) {
  if (!all || result.trajectory.empty()) return std::nullopt;
  const Eigen::Isometry3d T_first_world =
      all->at(result.scan_of_pose.front()).T_map_lidar.inverse();
  Trajectory truth;
  for (std::size_t i = 0; i < result.scan_of_pose.size(); ++i) {
    const Eigen::Isometry3d T_first_lidar =
        T_first_world * all->at(result.scan_of_pose[i]).T_map_lidar;
    truth.push_back(
        {result.trajectory[i].stamp_ns, motion_of_frame(body.T_body_lidar, T_first_lidar)});
  }
  return truth;
}

evaluation::PosePairs pairs_of(const Trajectory& truth, const Trajectory& estimate) {
  evaluation::PosePairs pairs;
  for (const StampedPose& pose : truth) pairs.truth.push_back(pose.T_map_lidar);
  for (const StampedPose& pose : estimate) pairs.estimate.push_back(pose.T_map_lidar);
  return evaluation::pair_by_index(pairs.truth, pairs.estimate);
}

/// Saves a drive into a copy of the map that it was put onto.
void save_session(const std::filesystem::path& file, const EarlierMap& earlier,
                  const MappingResult& result, SavedMap map, const std::string& source) {
  const std::int64_t clock_offset_ns = result.session->clock_offset_ns;
  map.trajectory = earlier.saved().trajectory;
  // What is known of the map stays known: where it lies on the earth above all.
  for (const auto& [key, value] : earlier.saved().metadata) map.metadata.try_emplace(key, value);
  for (StampedPose pose : result.trajectory) {
    pose.stamp_ns += clock_offset_ns;
    map.trajectory.push_back(pose);
  }
  map.view.map_id = new_map_id();
  map.is_partial = true;
  earlier.copy_to(file);
  add_map_session(file, map,
                  {.source = source,
                   .clock_offset_ns = clock_offset_ns,
                   .closures = result.session->alignment.closures.size()});
}

void save_map(const std::filesystem::path& file, const MappingTask& task,
              const MappingResult& result, const std::string& source) {
  SavedMap map{.view = *result.view,
               .tile_evidence = result.tile_evidence,
               .trajectory = result.trajectory,
               .metadata = {{"sensor", task.config.sensor.name},
                            {"label_source", result.label_source},
                            {"software", "stillmap " STILLMAP_VERSION},
                            {map_ended_key, "yes"}}};
  if (result.loops && result.loops->gnss && result.loops->gnss->datum)
    map.metadata["datum"] = to_text(*result.loops->gnss->datum);
  if (task.earlier_map != nullptr)
    return save_session(file, *task.earlier_map, result, std::move(map), source);
  open_map_file(file)->save(map);
  write_first_session(file, source);
}

/// The closures as pairs of poses of the run.
std::vector<std::pair<std::size_t, std::size_t>> closed_poses(const MappingResult& result) {
  std::map<std::size_t, std::size_t> pose_of_scan;
  for (std::size_t i = 0; i < result.scan_of_pose.size(); ++i)
    pose_of_scan[result.scan_of_pose[i]] = i;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const LoopClosure& closure : result.loops->closures)
    pairs.emplace_back(pose_of_scan.at(closure.from_scan), pose_of_scan.at(closure.to_scan));
  return pairs;
}

/// Writes the poses of the odometry, and where loops were closed, loops_before.png and
/// loops_after.png: the graph over the map.
void write_loops(const std::filesystem::path& folder, const MappingResult& result,
                 MapPictureOptions picture) {
  write_kitti_poses(folder / "poses_odometry.txt", result.odometry);
  if (!result.odometry_view) return;
  picture.closures = closed_poses(result);
  write_map_picture(folder / "loops_before.png", *result.odometry_view, result.odometry, picture);
  write_map_picture(folder / "loops_after.png", *result.view, result.trajectory, picture);
}

/// Writes poses_lidar.txt or poses_base.txt, poses_tum.txt, map.stillmap, map.ply, map.pcd, map.png
/// and, with truth, trajectory.png and trajectory_error.png; what closed loops leave, where they
/// were looked for. Throws what their writers throw.
MapOutput write_map_output(const MapOutputFolder& out, const MappingTask& task,
                           const MappingResult& result, const std::string& source,
                           const std::optional<Trajectory>& truth) {
  const std::filesystem::path& folder = out.unfinished();
  const MappedBody& body = task.body;
  MapOutput output{.folder = out.path(),
                   .frame = body.frame,
                   .sensor = task.config.sensor.name,
                   .sensor_origin = {},
                   .recording_faults = {},
                   .accuracy = std::nullopt,
                   .odometry_accuracy = std::nullopt};
  write_kitti_poses(folder / pose_file_of(body.frame), result.trajectory);
  write_tum(folder / "poses_tum.txt", result.trajectory, body.frame);
  save_map(out.new_map_file(), task, result, source);
  export_ply(*result.view, folder / "map.ply");
  export_pcd(*result.view, folder / "map.pcd");
  MapPictureOptions picture;
  picture.truth = truth_of(truth, result, body);
  if (picture.truth && task.earlier_map != nullptr) {
    for (StampedPose& pose : *picture.truth)
      pose.T_map_lidar = result.trajectory.front().T_map_lidar * pose.T_map_lidar;
  }
  if (picture.truth) {
    const evaluation::PosePairs pairs = pairs_of(*picture.truth, result.trajectory);
    output.accuracy = report_trajectory(pairs);
    draw_trajectories(folder, pairs, *output.accuracy, GroundPlane::xy);
    if (result.loops)
      output.odometry_accuracy = report_trajectory(pairs_of(*picture.truth, result.odometry));
  }
  if (result.loops) write_loops(folder, result, picture);
  write_map_picture(folder / "map.png", *result.view, result.trajectory, picture);
  return output;
}

struct MapArguments {
  std::string dataset;
  RecordingArguments recording;
  std::string out = "stillmap_out";
  MapperArguments mapper;
  MountArguments mount;
  ScanRange range;
  OutputPolicy policy;
  std::string loops = "on";
  std::vector<std::string> denied_loops;
  std::string onto;
  std::string gnss = "on";
  std::vector<double> antenna;
  double save_period_s = 30.0;
  bool json = false;
};

MappingResult map_with_progress(const MappingTask& task, std::unique_ptr<Segmenter> labels,
                                RunFile& run_file, StopSignal& stop) {
  const ScanDataset& dataset = task.dataset;
  if (dataset.kitti_lidar()) std::cerr << "stillmap: " << dataset.kitti_lidar()->in_words() << "\n";
  const std::size_t total = task.range.end(dataset) - task.range.first;
  Progress progress("map", "scans", total);
  std::size_t skipped = 0;
  const auto scan_done = [&](std::size_t seen) {
    progress.update(seen, skipped == 0 ? "" : std::to_string(skipped) + " skipped");
    return !stop.requested();
  };
  const auto scan_skipped = [&](const SkippedScan& scan) {
    ++skipped;
    progress.say("stillmap: skipped: " + scan.reason);
  };
  std::optional<Progress> correction;
  const auto scan_moved = [&](std::size_t done, std::size_t scans) {
    if (!correction) correction.emplace("map by corrected poses", "scans", scans);
    correction->update(done);
    return !stop.requested();
  };
  return map_dataset(
      task, std::move(labels), run_file,
      {.scan_done = scan_done, .scan_skipped = scan_skipped, .scan_moved = scan_moved});
}

/// Throws std::invalid_argument for what is not FROM:TO or not of this run's scans, and where loops
/// are left open.
std::vector<DeniedLoop> denied_loops(const MapArguments& arguments, const ScanDataset& dataset) {
  if (!arguments.denied_loops.empty() && arguments.loops != "on")
    throw std::invalid_argument("--deny-loop needs --loops on: nothing is closed without it");
  std::vector<DeniedLoop> all;
  for (const std::string& text : arguments.denied_loops) {
    DeniedLoop denied;
    const char* const end = text.data() + text.size();
    const auto [colon, fault] = std::from_chars(text.data(), end, denied.from_scan);
    const bool has_first = fault == std::errc() && colon != end && *colon == ':';
    const auto [rest, other_fault] =
        std::from_chars(has_first ? colon + 1 : end, end, denied.to_scan);
    if (!has_first || other_fault != std::errc() || rest != end ||
        denied.from_scan >= denied.to_scan) {
      throw std::invalid_argument("--deny-loop " + text +
                                  ": must be FROM:TO, two scans of which the second came later, "
                                  "as 'stillmap loops' lists them");
    }
    const std::size_t after_last = arguments.range.end(dataset);
    if (denied.from_scan < arguments.range.first || denied.to_scan >= after_last) {
      throw std::invalid_argument("--deny-loop " + text + ": is not of the scans to be mapped, " +
                                  std::to_string(arguments.range.first) + " to " +
                                  std::to_string(after_last - 1));
    }
    all.push_back(denied);
  }
  return all;
}

/// A receiver's fixes, and where its antenna is by the command line or the server's file. A drive
/// that is put onto a map has the place of that map. Throws std::invalid_argument, and DatasetError
/// for a damaged file.
GnssOptions gnss_options(const MapArguments& arguments, const ScanDataset& dataset,
                         const MappedBody& body) {
  const bool is_used = arguments.loops == "on" && arguments.gnss == "on" && arguments.onto.empty();
  if (!arguments.antenna.empty() && !is_used)
    throw std::invalid_argument(
        "--antenna needs --loops on and --gnss on, and goes not with --onto");
  const std::string& file = arguments.mapper.config_file;
  GnssReceiverConfig receiver = file.empty() ? GnssReceiverConfig{} : load_server_config(file).gnss;
  if (!arguments.antenna.empty())
    receiver.antenna_base = Eigen::Map<const Eigen::Vector3d>(arguments.antenna.data());
  GnssOptions options;
  options.config.max_sigma_m = receiver.max_sigma_m;
  options.config.delay_s = receiver.time_offset_s;
  if (receiver.antenna_base) {
    // Eigen's maxCoeff may step over NaN.
    constexpr double largest_m = 1000.0;
    if (!receiver.antenna_base->allFinite() ||
        receiver.antenna_base->cwiseAbs().maxCoeff() > largest_m)
      throw std::invalid_argument("--antenna needs finite numbers: x,y,z in metres");
    options.antenna_lidar = body.T_body_lidar.inverse() * *receiver.antenna_base;
  } else {
    options.config.expect_antenna_anywhere();
  }
  if (is_used) options.fixes = dataset.gnss();
  return options;
}

/// How loops are closed, but for the file of the scans, which is the output folder's; nothing where
/// they are left open. Throws what denied_loops() and gnss_options() throw, then, too.
std::optional<LoopOptions> loop_options(const MapArguments& arguments, const MappingTask& task) {
  LoopOptions options{.scans_file = {},
                      .max_range_m = task.config.static_map.max_range_m,
                      .denied = denied_loops(arguments, task.dataset),
                      .gnss = gnss_options(arguments, task.dataset, task.body)};
  return arguments.loops == "on" ? std::optional(std::move(options)) : std::nullopt;
}

/// FNV-1a of a file's bytes, which tells one text from another.
std::uint64_t digest_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::uint64_t digest = 0xcbf29ce484222325U;
  for (char byte = 0; in.get(byte);)
    digest = (digest ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  return digest;
}

/// What makes the parts of a run one map.
RunIdentity run_identity(const MapArguments& arguments, const MappingTask& task,
                         const Segmenter& labels) {
  const Eigen::Vector3d t = task.body.T_body_lidar.translation();
  const Eigen::Quaterniond q(task.body.T_body_lidar.rotation());
  std::ostringstream settings;
  settings << "sensor " << task.config.sensor.name << ", labels " << labels.name() << ", weighting "
           << name(task.config.odometry.weighting) << ", voxels of "
           << task.config.static_map.voxel_size_m << " m, lidar in " << task.body.frame << " at "
           << t.transpose() << " turned by " << q.coeffs().transpose()
           << (arguments.loops == "on" ? ", loops closed" : "")
           << (arguments.gnss == "on" ? "" : ", without GNSS")
           << (task.earlier_map == nullptr ? "" : ", onto " + task.earlier_map->identity());
  const std::string& label_kind = arguments.recording.label_kind;
  if (!label_kind.empty()) settings << ", label kind " << label_kind;
  if (const std::size_t clouds = task.dataset.clouds_per_turn(); clouds > 1)
    settings << ", turns of " << clouds << " clouds";
  for (const double metres : arguments.antenna) settings << ", antenna " << metres;
  for (const std::string& denied : arguments.denied_loops) settings << ", not " << denied;
  if (!arguments.mapper.config_file.empty())
    settings << ", configuration of digest " << digest_of(arguments.mapper.config_file);
  // A bag's scans bear the name of their topic, whether or not the command line says it.
  const std::filesystem::path recording = std::filesystem::weakly_canonical(
      dds::is_bag(arguments.dataset) ? task.dataset.file(task.range.first).parent_path()
                                     : std::filesystem::path(arguments.dataset));
  return {recording.string() + " from scan " + std::to_string(task.range.first), settings.str()};
}

/// Maps what is left to map; the run's file is closed after that. What is not recognised leaves
/// nothing to resume.
MappingResult map_into(MapOutputFolder& out, const MapArguments& arguments, const MappingTask& task,
                       std::unique_ptr<Segmenter> labels, StopSignal& stop) {
  try {
    RunFile run_file(out.run_file(), run_identity(arguments, task, *labels),
                     std::chrono::duration<double>(arguments.save_period_s));
    return map_with_progress(task, std::move(labels), run_file, stop);
  } catch (const MapNotRecognized&) {
    out.discard_run();
    throw;
  }
}

/// The map to go on in, where one is named. Throws what EarlierMap throws, and
/// std::invalid_argument for options that do not go with it.
std::unique_ptr<const EarlierMap> earlier_map(const MapArguments& arguments,
                                              const MapperConfig& config) {
  if (arguments.onto.empty()) return nullptr;
  if (arguments.loops != "on")
    throw std::invalid_argument("--onto needs --loops on: a drive is put onto a map by closures");
  std::error_code not_there;
  if (std::filesystem::equivalent(
          arguments.onto, std::filesystem::path(arguments.out) / "map.stillmap", not_there)) {
    throw std::invalid_argument(arguments.onto +
                                " is the map of --out, too, and would be replaced: the map that a "
                                "drive goes on in stays as it is; name another --out");
  }
  return std::make_unique<const EarlierMap>(arguments.onto, config.static_map);
}

ExitCode stopped_early(const MapOutputFolder& out, const std::string& what_is_there) {
  std::cerr << "stillmap: stopped early, as asked; " << what_is_there
            << "; 'stillmap map ... --out " << out.path().string() << " --resume' goes on\n";
  return ExitCode::failed;
}

ExitCode run(const MapArguments& arguments) {
  StopSignal stop;
  const dds::Recording recording =
      open_recording(arguments.dataset, arguments.recording, arguments.mapper.config_file,
                     arguments.range.strict, !arguments.mount.xyz_rpy.empty());
  const ScanDataset& dataset = recording.dataset;
  MappingTask task{.dataset = dataset,
                   .range = arguments.range,
                   .config = mapper_config(arguments.mapper, dataset.suggested_sensor()),
                   .body = body_of(arguments.mount, arguments.mapper.config_file)};
  static_cast<void>(task.range.end(dataset));
  task.loops = loop_options(arguments, task);
  const std::optional<Trajectory> truth = usable_truth(dataset);
  auto labels = make_segmenter(arguments.mapper, dataset, task.body.T_body_lidar);
  const std::unique_ptr<const EarlierMap> earlier = earlier_map(arguments, task.config);
  task.earlier_map = earlier.get();
  std::cerr << describe_sensor_mismatch(dataset, task.config.sensor)
            << describe_model(arguments.mapper, dataset, *labels);
  // Nothing above touched the folder.
  MapOutputFolder out(arguments.out, arguments.policy);
  if (task.loops) task.loops->scans_file = out.kept_scans_file();
  const MappingResult result = map_into(out, arguments, task, std::move(labels), stop);
  if (result.stopped && out.had_map()) {
    return stopped_early(out, out.path().string() + " holds the map that it held before");
  }
  if (result.stopped && earlier) return stopped_early(out, "no map was written yet");
  if (result.trajectory.empty()) {
    std::cerr << "stillmap: no scan of " << arguments.dataset << " could be mapped\n";
    return ExitCode::bad_input;
  }
  if (arguments.loops == "on" && !result.loops && !result.stopped) {
    std::cerr
        << "stillmap: loops are left open, since the sequence's stamps were set back and poses "
           "of before were dropped\n";
  }
  MapOutput output = write_map_output(out, task, result, arguments.dataset, truth);
  output.sensor_origin = sensor_origin(arguments.mapper);
  output.recording_faults = recording.faults;
  const Json report = to_json(result, output);
  write_report(out.unfinished() / "report.json", report);
  out.publish(result.stopped);
  std::cout << (arguments.json ? report.dump(2) + "\n" : describe(result, output));
  if (!result.stopped) return ExitCode::ok;
  return stopped_early(out, "the files hold what was mapped" +
                                std::string(arguments.loops == "on" ? ", loops open" : ""));
}

void add_output_options(CommandHandle command, MapArguments& arguments) {
  constexpr int seconds_of_a_year = 365 * 86400;
  command.option("--out,--output,-o", arguments.out, "Folder for the results").with_default();
  command.flag("--force", arguments.policy.force,
               "Replace results that are there already, once the new ones are complete");
  command.flag("--resume", arguments.policy.resume,
               "Go on with the run that was stopped or killed in this folder");
  command
      .option("--save-period", arguments.save_period_s,
              "Seconds between saves of the run, for --resume")
      .with_default()
      .above_zero_to(seconds_of_a_year);
  command.flag("--json", arguments.json, "Print report.json instead of the summary");
}

void add_loop_options(CommandHandle command, MapArguments& arguments) {
  command
      .option("--loops", arguments.loops,
              "on: where the drive comes back to a place, poses and map are corrected; off: as "
              "odometry has them")
      .one_of({"on", "off"})
      .with_default();
  command.option("--deny-loop", arguments.denied_loops,
                 "FROM:TO, a closure that is wrong, as 'stillmap loops' lists it: nothing joins "
                 "these places again; may be given several times");
  command.option("--onto", arguments.onto,
                 "A map made earlier: the drive goes on in a copy of it, as another session, where "
                 "it is recognised; this file is only read");
  command
      .option("--gnss", arguments.gnss,
              "on: fixes of a receiver beside the scans (gnss.csv, a bag's only NavSatFix) say "
              "where the map lies on the earth, and correct it; off: they are not read")
      .one_of({"on", "off"})
      .with_default();
  command
      .option("--antenna", arguments.antenna,
              "x,y,z [m] of the receiver's antenna on the robot, or by the lidar without --mount; "
              "without it no fix is taken for better than 1 m")
      .exactly(3)
      .comma_separated();
}

}  // namespace

void add_map_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<MapArguments>();
  CommandHandle command = program.command(
      "map", "Map a sequence or bag in this process: the server's mapper without DDS");
  command.option("DATASET", arguments->dataset, dataset_kinds).required();
  add_recording_options(command, arguments->recording);
  add_mapper_options(command, arguments->mapper);
  add_mount_option(command, arguments->mount,
                   "Poses of the robot, and the map from where it stands, as a server has them");
  add_range_options(command, arguments->range);
  add_loop_options(command, *arguments);
  add_output_options(command, *arguments);
  command.explain(
      "Examples:\n"
      "  stillmap map sequences/00 --out kitti00 --scans 500\n"
      "  stillmap map my_vlp16_pcds --sensor vlp_16 --labels none --out campus\n"
      "  stillmap map city --weighting none --out plain --json | jq .accuracy\n"
      "  stillmap map tuesday --onto monday/map.stillmap --out both\n"
      "Writes map.stillmap (SQLite), map.ply, map.pcd, map.png, poses_lidar.txt (KITTI 3x4, lidar "
      "frame; poses_base.txt with --mount), poses_tum.txt (the same with stamps), report.json "
      "(timing, memory, accuracy), and with true poses in the sequence trajectory.png and "
      "trajectory_error.png. Where the drive comes back to a place, loops are closed: the poses "
      "above are the corrected ones, poses_odometry.txt has those of before, report.json the "
      "closures ('stillmap loops' lists them, --deny-loop undoes one), loops_before.png and "
      "loops_after.png show them. The scans are kept in the folder 'unfinished' until then (some "
      "0.1 MB a scan of 16 rings).\n"
      "A damaged file is named and skipped; its scan then has no pose. "
      "A receiver's fixes make report.json's loops.gnss.datum, which map.stillmap keeps for "
      "GeoTIFFs.\n"
      "With --onto the drive is looked for in the map, scan by scan until some agree, "
      "then submap by submap; poses and map are in the earlier map's frame, what is gone is "
      "removed, what is new is added, and what the drive did not see stays. Exit code 5: it was "
      "not recognised, and nothing was written. 'stillmap sessions' lists the drives of a map and "
      "withdraws one.\n"
      "Until the results are complete they are in the folder 'unfinished', and "
      "those that were there stay.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
