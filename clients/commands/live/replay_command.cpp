#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/arguments/mount_arguments.hpp"
#include "clients/commands/arguments/scan_range.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/dataset/recording.hpp"
#include "clients/commands/live/replay_clock.hpp"
#include "clients/commands/live/replay_poses.hpp"
#include "clients/commands/mapping/pose_files.hpp"
#include "clients/commands/mapping/sample_feed.hpp"
#include "clients/library/client.hpp"
#include "clients/library/scan_publisher.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/topic_name.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "idl/interface/participant_diagnostics.hpp"

namespace stillmap::cli {
namespace {

struct ReplayOptions {
  ScanRange range;
  /// Times real time; 0: as fast as the server takes scans.
  double rate = 1.0;
  bool with_labels = true;
  /// Longest wait of a lossless publisher for the server to take a scan.
  std::chrono::milliseconds idle_timeout{30'000};
};

struct ReplayResult {
  std::vector<std::int64_t> published_stamps_ns;
  std::vector<SkippedScan> skipped;
  double seconds = 0.0;
  bool acknowledged = false;
  bool stopped = false;
};

/// Scans that the server has mapped and dropped since an earlier status.
struct ServerCounts {
  std::uint64_t mapped = 0;
  std::uint64_t dropped = 0;
  /// It was started again meanwhile: the rest it counted before is not known.
  bool is_restarted = false;
};

using Clock = ReplayClock::Clock;
constexpr std::chrono::milliseconds publish_step{500};
constexpr std::chrono::milliseconds imu_patience{1000};
constexpr std::chrono::milliseconds status_period{100};
/// A server sends its path, if there is one, to those who come late.
constexpr std::chrono::milliseconds path_patience{2000};

/// Returns true when a signal arrived first.
[[nodiscard]] bool wait_or_stop(Clock::time_point due, StopSignal& stop) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(due - Clock::now());
  return stop.wait_for(std::max(left, std::chrono::milliseconds(0)));
}

std::optional<DatasetFrame> read_scan(const ScanDataset& dataset, std::size_t index,
                                      const ReplayOptions& options, ReplayResult& result,
                                      const ScanSkipped& scan_skipped) {
  try {
    DatasetFrame frame = dataset.read(index);
    if (!options.with_labels) {
      frame.raw_labels.clear();
      frame.scan.labels.clear();
    }
    // The unit of this sensor's driver; the server scales it back.
    for (float& value : frame.scan.intensity) value /= dataset.suggested_sensor().intensity_scale;
    return frame;
  } catch (const DatasetError& error) {
    if (options.range.strict) throw;
    result.skipped.push_back({index, "unreadable", error.what()});
    scan_skipped(result.skipped.back());
    return std::nullopt;
  }
}

/// Throws when the server takes nothing for too long.
void require_progress(Clock::time_point began, const ReplayOptions& options) {
  if (Clock::now() - began <= options.idle_timeout) return;
  throw ServiceTimeout(
      "the server has taken no scan for " + std::to_string(options.idle_timeout.count() / 1000) +
      " s: did it stop? 'stillmap status' tells; a lossless replay needs a server with input "
      "delivery: every");
}

/// What was recorded beside the scans.
struct SensorFeeds {
  SampleFeed<ImuSample> imu;
  SampleFeed<GnssFix> gnss;
};

// Samples before their scan: the server waits for those of a scan's sweep, but not long.
template <typename Sample>
bool publish(ScanPublisher& publisher, std::span<const Sample> samples,
             const ReplayOptions& options, StopSignal& stop) {
  const auto began = Clock::now();
  while (!samples.empty()) {
    samples = samples.subspan(publisher.publish(samples, publish_step));
    if (stop.requested()) return false;
    if (!samples.empty()) require_progress(began, options);
  }
  return true;
}

// In short steps, so that a signal ends the wait for the server. Returns false after a signal.
bool publish(ScanPublisher& publisher, const DatasetFrame& frame, const ReplayOptions& options,
             StopSignal& stop) {
  const auto began = Clock::now();
  while (!publisher.publish(frame.scan, frame.raw_labels, publish_step)) {
    if (stop.requested()) return false;
    require_progress(began, options);
  }
  return true;
}

/// Publishes the scans of a sequence at the times of their stamps. Throws ServiceTimeout when the
/// server stops taking scans, DatasetError as ScanRange says.
ReplayResult replay_dataset(const ScanDataset& dataset, SensorFeeds feeds,
                            const ReplayOptions& options, ScanPublisher& publisher,
                            StopSignal& stop, const ScanDone& scan_done,
                            const ScanSkipped& scan_skipped) {
  const std::size_t end = options.range.end(dataset);
  const auto began = Clock::now();
  ReplayClock clock(began, dataset.stamp_ns(options.range.first), options.rate);
  ReplayResult result;
  for (std::size_t index = options.range.first; index < end && !result.stopped; ++index) {
    const auto frame = read_scan(dataset, index, options, result, scan_skipped);
    if (frame) {
      const double period_s = dataset.suggested_sensor().period_s;
      const auto samples = feeds.imu.take_up_to_end_of(frame->scan, period_s);
      const auto fixes = feeds.gnss.take_up_to_end_of(frame->scan, period_s);
      result.stopped = wait_or_stop(clock.due(frame->scan.stamp_ns), stop) ||
                       !publish(publisher, samples, options, stop) ||
                       !publish(publisher, fixes, options, stop) ||
                       !publish(publisher, *frame, options, stop);
      if (!result.stopped) result.published_stamps_ns.push_back(frame->scan.stamp_ns);
    }
    (void)scan_done(index + 1 - options.range.first);
  }
  // In short steps, so that a signal ends this, too.
  const auto published = Clock::now();
  while (!stop.requested() && !result.acknowledged &&
         Clock::now() - published < options.idle_timeout)
    result.acknowledged = publisher.wait_for_all_acknowledged(publish_step);
  result.seconds = std::chrono::duration<double>(Clock::now() - began).count();
  return result;
}

/// Of a server that was restarted meanwhile, all that it has counted.
ServerCounts counts_since(const dds::ServerStatus& before, const dds::ServerStatus& now) {
  const std::uint64_t mapped_before = before.counter("scans_mapped");
  const bool is_restarted =
      now.counter("scans_mapped") < mapped_before || now.dropped() < before.dropped();
  return {.mapped = now.counter("scans_mapped") - (is_restarted ? 0 : mapped_before),
          .dropped = now.dropped() - (is_restarted ? 0 : before.dropped()),
          .is_restarted = is_restarted};
}

/// How long nothing may change before a server is waited for no longer.
struct Patience {
  /// Until the first scan was mapped or dropped: a server may be slow to begin.
  std::chrono::milliseconds first;
  std::chrono::milliseconds next;
};

/// Of a lossy topic, which loses scans that are not counted, the last ones are not waited for long.
Patience patience_of(const ReplayOptions& options, bool is_lossless, bool server_takes_topic) {
  constexpr std::chrono::seconds lossy{2};
  return {.first = is_lossless || server_takes_topic ? options.idle_timeout : lossy,
          .next = is_lossless ? options.idle_timeout : lossy};
}

/// Polls the status until the server has mapped or dropped `scans` of them since `before`, or
/// patience is over. Returns the last status.
dds::ServerStatus wait_until_mapped(Client& client, const dds::ServerStatus& before,
                                    std::uint64_t scans, const Patience& patience,
                                    StopSignal& stop) {
  dds::ServerStatus status = client.status();
  auto changed = Clock::now();
  std::uint64_t done_before = 0;
  while (true) {
    const ServerCounts counts = counts_since(before, status);
    const std::uint64_t done = counts.mapped + counts.dropped;
    if (done != std::exchange(done_before, done)) changed = Clock::now();
    const auto idle_timeout = done == 0 ? patience.first : patience.next;
    if (done >= scans || Clock::now() - changed > idle_timeout) return status;
    if (stop.wait_for(status_period)) return status;
    status = client.status();
  }
}

struct ReplayArguments {
  std::string dataset;
  RecordingArguments recording;
  ClientArguments client;
  ReplayOptions replay;
  /// 0: not given.
  double rate = 0.0;
  std::string topic = "points";
  /// header.frame_id of the clouds.
  std::string frame = "lidar";
  std::string base_frame = "base_link";
  MountArguments mount;
  std::string imu_topic = "imu/data";
  std::string gnss_topic = "fix";
  std::string out;
  std::uint32_t subscribers = 1;
  bool lossless = false;
  bool json = false;
};

struct ReplayOutcome {
  ReplayResult replay;
  /// Nothing where a signal ended the replay: then nobody waits for a server that may hang.
  std::optional<ServerCounts> server;
  /// Scans may be for others alone, on a topic of theirs.
  bool server_takes_topic = false;
  Trajectory poses;
  /// What they are poses of.
  std::string frame;
};

void require_subscribers(ScanPublisher& publisher, const ReplayArguments& arguments,
                         StopSignal& stop) {
  const auto deadline = std::chrono::steady_clock::now() + arguments.client.timeout();
  const auto requested = static_cast<int>(arguments.subscribers);
  while (publisher.subscribers() < requested && std::chrono::steady_clock::now() < deadline) {
    if (stop.wait_for(std::chrono::milliseconds(10))) return;
  }
  const int there = publisher.subscribers();
  if (there >= requested) return;
  throw ServiceTimeout(
      "a server answers in DDS domain " + std::to_string(arguments.client.domain) + ", but " +
      (there == 0
           ? "nobody takes"
           : "only " + std::to_string(there) + " of " + std::to_string(requested) + " take") +
      " scans from topic '" + arguments.topic + "': is that its topics.points?");
}

void require_lossless(const dds::ServerStatus& status) {
  for (const dds::Diagnostic& diagnostic : status.diagnostics) {
    if (!dds::is_of_namesake(diagnostic)) continue;
    throw std::invalid_argument(diagnostic.what +
                                ": either may answer what it has mapped, so a lossless replay "
                                "cannot be counted; " +
                                diagnostic.hint);
  }
  if (status.delivery == DeliveryMode::every) return;
  throw std::invalid_argument(
      "the server drops scans when they come too fast (input delivery: latest), so the replay "
      "cannot be lossless: start it with --delivery every");
}

ReplayOptions replay_options(const ReplayArguments& arguments) {
  ReplayOptions options = arguments.replay;
  options.rate = arguments.rate > 0.0 ? arguments.rate : arguments.lossless ? 0.0 : 1.0;
  options.idle_timeout = std::max(options.idle_timeout, arguments.client.timeout());
  return options;
}

ReplayResult publish_with_progress(const ScanDataset& dataset, SensorFeeds feeds,
                                   const ReplayArguments& arguments, ScanPublisher& publisher,
                                   StopSignal& stop) {
  const ScanRange& range = arguments.replay.range;
  Progress progress("replay", "scans", range.end(dataset) - range.first);
  return replay_dataset(
      dataset, std::move(feeds), replay_options(arguments), publisher, stop,
      [&](std::size_t seen) {
        progress.update(seen);
        return true;
      },
      [&](const SkippedScan& scan) { progress.say("stillmap: skipped: " + scan.reason); });
}

std::optional<FrameTransform> mount_of(const ReplayArguments& arguments) {
  const auto T_base_lidar = arguments.mount.T_base_lidar();
  if (!T_base_lidar) return std::nullopt;
  return FrameTransform{arguments.base_frame, arguments.frame, *T_base_lidar};
}

/// Says what of the recording is not as it seems. Throws what its parts throw, and
/// std::invalid_argument for a range that has no scan.
ScanDataset open_dataset(const ReplayArguments& arguments) {
  ScanDataset dataset =
      open_recording(arguments.dataset, arguments.recording, {}, arguments.replay.range.strict,
                     !arguments.mount.xyz_rpy.empty())
          .dataset;
  if (arguments.replay.with_labels) warn_of_label_kind(dataset);
  (void)arguments.replay.range.end(dataset);
  if (dataset.kitti_lidar()) std::cerr << "stillmap: " << dataset.kitti_lidar()->in_words() << "\n";
  return dataset;
}

/// Waits until the server has done with the scans that were published, and the poses of those that
/// it mapped are there.
void await_server(Client& client, const dds::ServerStatus& before, const ReplayArguments& arguments,
                  ReplayPoses& poses, StopSignal& stop, ReplayOutcome& outcome) {
  const std::vector<std::int64_t>& stamps_ns = outcome.replay.published_stamps_ns;
  outcome.server_takes_topic = before.points_topic == arguments.topic;
  const Patience patience =
      patience_of(replay_options(arguments), arguments.lossless, outcome.server_takes_topic);
  const dds::ServerStatus after =
      wait_until_mapped(client, before, stamps_ns.size(), patience, stop);
  outcome.server = counts_since(before, after);
  if (outcome.server->is_restarted)
    std::cerr << "stillmap: the server was restarted during the replay: what it counted before is "
                 "lost\n";
  if (outcome.server->mapped == stamps_ns.size())
    poses.wait_for(stamps_ns, arguments.client.timeout());
}

ReplayOutcome replay(const ReplayArguments& arguments, StopSignal& stop) {
  const ScanDataset dataset = open_dataset(arguments);
  SensorFeeds feeds{SampleFeed(dataset.imu()), SampleFeed(dataset.gnss())};
  const bool has_imu = !feeds.imu.empty();
  Client client = connect(arguments.client);
  ReplayPoses poses;
  const Subscription odometry =
      client.subscribe_odometry([&poses](const OdometryUpdate& update) { poses.take(update); });
  const Subscription path =
      client.subscribe_path([&poses](const Trajectory& poses_map) { poses.take(poses_map); });
  ScanPublisher publisher(client, {.dds = arguments.client.dds(DdsRole::sensor),
                                   .points_topic = arguments.topic,
                                   .imu_topic = has_imu ? arguments.imu_topic : "",
                                   .gnss_topic = feeds.gnss.empty() ? "" : arguments.gnss_topic,
                                   .lidar_frame = arguments.frame,
                                   .mount = mount_of(arguments),
                                   .lossless = arguments.lossless});
  require_subscribers(publisher, arguments, stop);
  // Found with the scans' subscriber; a server need not have one.
  if (has_imu) (void)publisher.wait_for_imu_subscriber(imu_patience);
  const dds::ServerStatus before = client.status();
  if (arguments.lossless) require_lossless(before);
  if (before.map_version > 0) poses.wait_for_path(path_patience);
  poses.begin();
  ReplayOutcome outcome;
  outcome.replay = publish_with_progress(dataset, std::move(feeds), arguments, publisher, stop);
  if (!stop.requested()) await_server(client, before, arguments, poses, stop, outcome);
  outcome.poses = poses.poses_of(outcome.replay.published_stamps_ns);
  outcome.frame = poses.frame();
  return outcome;
}

Json to_json(const ReplayOutcome& outcome) {
  return {{"published", outcome.replay.published_stamps_ns.size()},
          {"acknowledged", outcome.replay.acknowledged},
          {"skipped", outcome.replay.skipped.size()},
          {"mapped", outcome.server ? Json(outcome.server->mapped) : Json(nullptr)},
          {"dropped", outcome.server ? Json(outcome.server->dropped) : Json(nullptr)},
          {"poses", outcome.poses.size()},
          {"poses_frame", outcome.frame + "; the map is its place at the server's first scan"},
          {"seconds", outcome.replay.seconds},
          {"interrupted", outcome.replay.stopped}};
}

std::string describe(const ReplayOutcome& outcome) {
  const auto published = static_cast<double>(outcome.replay.published_stamps_ns.size());
  return std::to_string(outcome.replay.published_stamps_ns.size()) + " scans published in " +
         fixed(outcome.replay.seconds, 1) + " s (" + fixed(published / outcome.replay.seconds, 1) +
         "/s), " + (outcome.replay.acknowledged ? "all" : "not all") + " acknowledged, " +
         std::to_string(outcome.replay.skipped.size()) + " damaged ones skipped\n" +
         (outcome.server ? "the server mapped " + std::to_string(outcome.server->mapped) +
                               " and dropped " + std::to_string(outcome.server->dropped)
                         : "what the server mapped was not waited for") +
         "; " + std::to_string(outcome.poses.size()) + " poses came back\n";
}

constexpr const char* no_scan_twice =
    "A server takes no scan twice: 'stillmap reset' makes it start over";

/// Whether the server mapped what was to be mapped; says why not. A lossy replay may lose scans,
/// but not all.
bool is_success(const ReplayArguments& arguments, const ReplayOutcome& outcome) {
  const std::size_t published = outcome.replay.published_stamps_ns.size();
  const std::uint64_t mapped = outcome.server->mapped;
  const bool is_complete = mapped >= published && outcome.poses.size() == published;
  if (arguments.lossless && !is_complete) {
    std::cerr << "stillmap: the replay was to be lossless, but the server mapped " << mapped
              << " of " << published << " scans, and " << outcome.poses.size()
              << " poses came back; 'stillmap status' counts why. " << no_scan_twice
              << " A server joins clouds that are parts of a turn, unless its file has "
                 "'input: {clouds_per_turn: 1}'.\n";
    return false;
  }
  const bool were_for_it = outcome.server_takes_topic || outcome.server->dropped > 0;
  if (mapped > 0 || published == 0 || !were_for_it) return true;
  std::cerr << "stillmap: the server mapped none of the " << published
            << " scans; 'stillmap status' counts why. " << no_scan_twice << "\n";
  return false;
}

ExitCode run(const ReplayArguments& arguments) {
  StopSignal stop;
  const ReplayOutcome outcome = replay(arguments, stop);
  if (!arguments.out.empty()) write_poses_as_named(arguments.out, outcome.poses, outcome.frame);
  std::cout << (arguments.json ? to_json(outcome).dump(2) + "\n" : describe(outcome));
  if (!arguments.json && !arguments.out.empty()) {
    std::cout << "poses written to " << arguments.out << " (frame '" << outcome.frame
              << "'; the map is its place at the server's first scan)\n";
  }
  if (!outcome.server || outcome.replay.stopped) return ExitCode::failed;
  return is_success(arguments, outcome) ? ExitCode::ok : ExitCode::failed;
}

}  // namespace

void add_replay_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<ReplayArguments>();
  ReplayOptions& replay = arguments->replay;
  CommandHandle command =
      program.command("replay", "Publish a sequence or bag on DDS, as a lidar driver would");
  command.option("DATASET", arguments->dataset, dataset_kinds).required();
  add_recording_options(command, arguments->recording);
  command
      .option("--rate", arguments->rate,
              "Times real time; default 1, with --lossless as fast as the server maps")
      .above_zero();
  command.flag("--lossless", arguments->lossless,
               "Wait for the server instead of letting it drop scans (its input delivery "
               "must be 'every')");
  command.option("--out,--output,-o", arguments->out,
                 "Write the poses that came back: KITTI 3x4, or with stamps to FILE.tum");
  add_range_options(command, replay.range);
  command.flag("--labels,!--no-labels", replay.with_labels,
               "Send the labels of the sequence, where it has any (default)");
  command.option("--topic", arguments->topic, "ROS 2 name of the topic")
      .corrected(to_topic_name)
      .with_default();
  command
      .option("--imu-topic", arguments->imu_topic,
              "ROS 2 name of the topic for the samples of an IMU, where the sequence has any")
      .corrected(to_topic_name_or_empty)
      .with_default();
  command
      .option("--gnss-topic", arguments->gnss_topic,
              "The same for the fixes of a GNSS receiver; the server's topics.gnss")
      .corrected(to_topic_name_or_empty)
      .with_default();
  command
      .option("--subscribers", arguments->subscribers,
              "Begin when so many take the scans: the server, and 'stillmap record', say")
      .between(1, 1000)
      .with_default();
  add_frame_option(command, "--frame", arguments->frame, "The clouds' frame (header.frame_id)");
  const OptionHandle mount = add_mount_option(command, arguments->mount, "Publish on /tf_static");
  add_frame_option(command, "--base", arguments->base_frame, "The robot's frame there")
      .needs(mount);
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap replay sequences/00 --rate 2\n"
      "  stillmap replay city --lossless --out poses_lidar.txt\n"
      "  stillmap replay city --mount 1.2,0,1.4,0,15,0   # for mount: {source: tf_static}\n"
      "Of a pause in the recording, 10 s are waited at most.\n"
      "Ends when the server has processed what was sent, and prints the counts. Exit code 1 when a "
      "lossless replay lost something or none was mapped, 3 when no server answers or it stops "
      "taking scans.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
