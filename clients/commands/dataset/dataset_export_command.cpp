#include <Eigen/Geometry>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/dataset/drive_labels.hpp"
#include "clients/commands/dataset/live_export.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/commands/dataset/sequence_export.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "config/loaders/sensor_file.hpp"
#include "config/loaders/topic_name.hpp"

namespace stillmap::cli {
namespace {

constexpr std::string_view topic_prefix = "topic:";

struct DatasetExportArguments {
  std::string source;
  RecordingArguments recording;
  std::string out;
  MapperArguments mapper;
  ScanRange range;
  ClientArguments client;
  std::string drive_votes;
  double idle_timeout_s = 10.0;
  bool force = false;
  bool json = false;
};

Json to_json(const DatasetExportArguments& arguments, const ExportSummary& summary) {
  Json remarks = Json::array();
  for (const auto& [scans, text] : summary.remarks) {
    remarks.push_back({{"scans", scans}, {"remark", text}});
  }
  return {{"folder", arguments.out},
          {"scans", summary.scans},
          {"points", summary.points},
          {"labelled_points", summary.labelled_points},
          {"label_source", summary.label_source},
          {"imu_samples", summary.imu_samples},
          {"gnss_fixes", summary.gnss_fixes},
          {"poses_frame", "camera of calib.txt: scan k into scan 0; its lidar frame is Tr^-1 T Tr"},
          {"remarks", remarks},
          {"interrupted", summary.stopped}};
}

std::string describe(const DatasetExportArguments& arguments, const ExportSummary& summary) {
  std::string text = std::to_string(summary.scans) + " scans, " + std::to_string(summary.points) +
                     " points (" + std::to_string(summary.labelled_points) +
                     " with a label from '" + summary.label_source + "'): " + arguments.out +
                     "/ (SemanticKITTI sequence; poses.txt is in the camera frame of calib.txt, as "
                     "KITTI's)\n";
  if (summary.imu_samples > 0)
    text += std::to_string(summary.imu_samples) + " samples of an IMU: imu.csv\n";
  if (summary.gnss_fixes > 0)
    text += std::to_string(summary.gnss_fixes) + " fixes of a GNSS receiver: gnss.csv\n";
  for (const auto& [scans, remark] : summary.remarks) {
    text.append(std::to_string(scans)).append(" ").append(remark).append("\n");
  }
  return text;
}

/// For training, which reads rows and field of view there: the lidar that was named, else the one
/// that the written scans show.
void write_sensor(const std::string& folder, const std::optional<SensorModel>& named) {
  save_sensor(named ? *named : ScanDataset(folder).suggested_sensor(),
              std::filesystem::path(folder) / "sensor.yaml");
}

/// Nobody could read a sensor.yaml of several lidars that make one scan.
void require_one_lidar(const std::string& config_file) {
  if (config_file.empty() || load_server_config(config_file).lidars.empty()) return;
  throw std::invalid_argument(config_file +
                              " lists several lidars ('sensors'), but a sequence is of one: give a "
                              "file with 'sensor', or name the lidar with --sensor");
}

/// Where the lidar sits on its robot, as the server's file says. It decides nothing but how a model
/// is shown the scans: what a sequence does not tell, /tf_static and which one of several lidars it
/// is of, is no fault.
std::optional<Eigen::Isometry3d> told_mount(const std::string& config_file) {
  const ServerConfig server =
      config_file.empty() ? ServerConfig{} : load_server_config(config_file);
  if (!server.lidars.empty() || server.mount.source == MountConfig::Source::tf_static)
    return std::nullopt;
  return server.mount.T_base_lidar;
}

std::string describe_untold_mount(const std::string& config_file) {
  return "stillmap: " + config_file +
         " does not say where this lidar sits ('mount' leaves it to /tf_static, or 'sensors' lists "
         "several): it is labelled as one without a mount\n";
}

ExportSummary export_from_dataset(const DatasetExportArguments& arguments, StopSignal& stop) {
  if (!arguments.mapper.names_sensor()) require_one_lidar(arguments.mapper.config_file);
  const ScanDataset dataset = open_recording(arguments.source, arguments.recording,
                                             arguments.mapper.config_file, arguments.range.strict)
                                  .dataset;
  // They are copied, whatever --labels says.
  require_semantic_kitti_labels(dataset);
  std::error_code ignored;
  if (std::filesystem::equivalent(arguments.source, arguments.out, ignored)) {
    throw std::invalid_argument(arguments.out + " is the source itself; name another folder");
  }
  const std::size_t total = arguments.range.end(dataset) - arguments.range.first;
  const MapperConfig config = mapper_config(arguments.mapper, dataset.suggested_sensor());
  const std::optional<Eigen::Isometry3d> mount = told_mount(arguments.mapper.config_file);
  MapperArguments mapper = arguments.mapper;
  mirror_with_drive_votes(arguments.drive_votes, mapper);
  auto labels = make_segmenter(mapper, dataset, mount.value_or(Eigen::Isometry3d::Identity()));
  std::cerr << describe_sensor_mismatch(dataset, config.sensor)
            << describe_model(arguments.mapper, dataset, *labels)
            << (mount || labels->details().empty()
                    ? std::string()
                    : describe_untold_mount(arguments.mapper.config_file));
  // What cannot be read is told before anything is replaced.
  static_cast<void>(dataset.imu());
  static_cast<void>(dataset.gnss());
  std::vector<std::filesystem::path> sources = dataset.all_files();
  sources.emplace_back(arguments.source);
  prepare_sequence_folder(arguments.out, arguments.force, sources);
  Progress progress("export", "scans", total);
  ExportSummary summary = export_sequence(
      dataset, arguments.range, config, std::move(labels), arguments.drive_votes != "off",
      arguments.out,
      [&](std::size_t seen) {
        progress.update(seen);
        return !stop.requested();
      },
      [&](const SkippedScan& scan) { progress.say("stillmap: " + scan.reason); });
  write_sensor(arguments.out, config.sensor);
  return summary;
}

/// Throws std::invalid_argument for an option that says nothing of a topic.
void check_options_of_topic(const DatasetExportArguments& arguments) {
  const char* const option = arguments.range.first != 0                ? "--start"
                             : arguments.range.strict                  ? "--strict"
                             : !arguments.recording.topic_in.empty()   ? "--topic-in"
                             : !arguments.recording.label_kind.empty() ? "--label-kind"
                             : !arguments.drive_votes.empty()          ? "--drive-votes"
                             : !arguments.mapper.mirrored.empty()      ? "--mirrored"
                                                                       : nullptr;
  if (option == nullptr) return;
  throw std::invalid_argument(std::string(option) + " is of recordings, and " + arguments.source +
                              " is a live topic: leave it out");
}

ExportSummary export_from_topic(const DatasetExportArguments& arguments, StopSignal& stop) {
  std::string topic = arguments.source.substr(topic_prefix.size());
  if (const std::string fault = to_topic_name(topic); !fault.empty()) {
    throw std::invalid_argument("SOURCE " + arguments.source + ": " + fault);
  }
  check_options_of_topic(arguments);
  ServerConfig config;
  if (!arguments.mapper.config_file.empty()) {
    config = load_server_config(arguments.mapper.config_file);
  }
  const bool names_sensor =
      arguments.mapper.names_sensor() ||
      (arguments.mapper.sensor.empty() && !config.automatic_sensor.is_on && config.lidars.empty());
  config.mapper = mapper_config(arguments.mapper, config.mapper.sensor);
  Client client = connect(arguments.client);
  prepare_sequence_folder(arguments.out, arguments.force);
  const LiveExportOptions options{
      .topic = std::move(topic),
      .scans = arguments.range.count,
      .idle_timeout =
          std::chrono::milliseconds(static_cast<std::int64_t>(1000.0 * arguments.idle_timeout_s))};
  const bool known_end = options.scans != SIZE_MAX;
  Progress progress("export", "scans", known_end ? options.scans : 0);
  progress.say("stillmap: waiting for scans on '" + options.topic + "'; Ctrl-C ends the sequence");
  ExportSummary summary = export_live(client, options, config, arguments.out, stop,
                                      [&](std::size_t scans) { progress.update(scans); });
  if (summary.scans > 0)
    write_sensor(arguments.out, names_sensor ? std::optional(config.mapper.sensor) : std::nullopt);
  summary.label_source = client.status().label_source;
  summary.stopped = known_end && summary.scans < options.scans;
  return summary;
}

ExitCode run(const DatasetExportArguments& arguments) {
  StopSignal stop;
  const ExportSummary summary = arguments.source.starts_with(topic_prefix)
                                    ? export_from_topic(arguments, stop)
                                    : export_from_dataset(arguments, stop);
  std::cout << (arguments.json ? to_json(arguments, summary).dump(2) + "\n"
                               : describe(arguments, summary));
  if (summary.stopped) {
    std::cerr << "stillmap: ended early; the sequence is complete up to there\n";
  }
  return summary.stopped || summary.scans == 0 ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_dataset_export_command(CommandHandle dataset, Action& action) {
  auto arguments = std::make_shared<DatasetExportArguments>();
  CommandHandle command = dataset.command(
      "export", "Write a data set, a bag or a live topic as a SemanticKITTI sequence");
  command
      .option("SOURCE", arguments->source,
              "A KITTI sequence, a folder of .bin, .pcd or .ply files, one such file, a ROS 2 bag "
              "(folder, .db3 or .mcap), or topic:NAME of a sensor that a running stillmap-server "
              "listens to")
      .required();
  add_recording_options(command, arguments->recording);
  command.option("OUT", arguments->out, "New folder for the sequence").required();
  add_mapper_options(command, arguments->mapper);
  add_drive_votes_option(command, arguments->drive_votes);
  add_range_options(command, arguments->range);
  command.flag("--force", arguments->force,
               "Replace a sequence that is there already, with its labels");
  command.flag("--json", arguments->json, "Print JSON");
  command.renamed("--silence", "--idle-timeout");
  command
      .option("--idle-timeout", arguments->idle_timeout_s,
              "Live: end when no scan has followed the last one for so long [s]")
      .above_zero_to(86400)
      .with_default();
  add_client_options(command, arguments->client);
  command.explain(
      "Examples:\n"
      "  stillmap dataset export my_pcds campus --labels my_model --sensor vlp_16\n"
      "  stillmap dataset export topic:points campus --config server.yaml --scans 600\n"
      "Writes velodyne/*.bin (every scan and point in the order of the source; intensity 0..1), "
      "labels/*.label (the source's own, else the first guess of --labels, see --drive-votes, of "
      "the running server, or 0; for --labels the lidar stands as the mount in the file of "
      "--config says, see --stance), times.txt, calib.txt, and poses.txt from our odometry: camera "
      "frame of scan k into camera frame of scan 0, where calib.txt's Tr takes lidar to camera (a "
      "camera that looks forward from the lidar's place). Point times and rings go to "
      "time_offsets/ and rings/, an IMU's samples and a GNSS receiver's fixes to imu.csv and "
      "gnss.csv (not of a live topic).\n"
      "Ctrl-C leaves a shorter sequence that is complete in "
      "itself; a new run starts over, as poses follow from all scans before. sensor.yaml is the "
      "lidar, for training. Live, give the server's own file with --config.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
