#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/live/pose_log.hpp"
#include "clients/commands/live/replay_run.hpp"
#include "clients/commands/mapping/pose_files.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"
#include "idl/bag/bag_scan_source.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string dataset;
  std::string topic_in;
  ClientArguments client;
  ReplayOptions replay;
  /// 0: not given.
  double rate = 0.0;
  std::string topic = "points";
  std::string out;
  std::uint32_t subscribers = 1;
  bool lossless = false;
  bool json = false;
};

struct ReplayOutcome {
  ReplayResult replay;
  ServerCounts server;
  Trajectory poses;
};

void require_subscribers(ScanPublisher& publisher, const Arguments& arguments, StopSignal& stop) {
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
  if (status.delivery == DeliveryMode::every) return;
  throw std::invalid_argument(
      "the server drops scans when they come too fast (input delivery: latest), so the replay "
      "cannot be lossless: start it with --delivery every");
}

ReplayOptions replay_options(const Arguments& arguments) {
  ReplayOptions options = arguments.replay;
  options.rate = arguments.rate > 0.0 ? arguments.rate : arguments.lossless ? 0.0 : 1.0;
  return options;
}

ReplayResult publish_with_progress(const ScanDataset& dataset, const Arguments& arguments,
                                   ScanPublisher& publisher, StopSignal& stop) {
  const ScanRange& range = arguments.replay.range;
  Progress progress("replay", "scans", range.end(dataset) - range.first);
  return replay_dataset(
      dataset, replay_options(arguments), publisher, stop,
      [&](std::size_t seen) {
        progress.update(seen);
        return true;
      },
      [&](const SkippedScan& scan) { progress.say("stillmap: left out: " + scan.reason); });
}

ReplayOutcome replay(const Arguments& arguments, StopSignal& stop) {
  const ScanDataset dataset = dds::open_sequence(arguments.dataset, arguments.topic_in);
  (void)arguments.replay.range.end(dataset);
  Client client = connect(arguments.client);
  PoseLog poses(client);
  ScanPublisher publisher(client, {.dds = arguments.client.dds(DdsRole::sensor),
                                   .points_topic = arguments.topic,
                                   .lossless = arguments.lossless});
  require_subscribers(publisher, arguments, stop);
  const dds::ServerStatus before = client.status();
  if (arguments.lossless) require_lossless(before);
  ReplayOutcome outcome;
  outcome.replay = publish_with_progress(dataset, arguments, publisher, stop);
  const std::vector<std::int64_t>& stamps_ns = outcome.replay.published_stamps_ns;
  // A lossy topic may have lost scans that nobody counts, so there the wait ends sooner.
  const auto idle_timeout =
      arguments.lossless ? arguments.replay.idle_timeout : std::chrono::seconds(2);
  const dds::ServerStatus after =
      wait_until_mapped(client, before, stamps_ns.size(), idle_timeout, stop);
  outcome.server = counts_since(before, after);
  if (outcome.server.mapped == stamps_ns.size()) {
    poses.wait_for(stamps_ns, std::chrono::seconds(5));
  }
  outcome.poses = poses.poses_of(stamps_ns);
  return outcome;
}

nlohmann::json to_json(const ReplayOutcome& outcome) {
  return {{"published", outcome.replay.published_stamps_ns.size()},
          {"acknowledged", outcome.replay.acknowledged},
          {"left_out", outcome.replay.skipped.size()},
          {"mapped", outcome.server.mapped},
          {"dropped", outcome.server.dropped},
          {"poses", outcome.poses.size()},
          {"poses_frame", "lidar; the map is the lidar frame of the server's first scan"},
          {"seconds", outcome.replay.seconds},
          {"stopped", outcome.replay.stopped}};
}

std::string describe(const ReplayOutcome& outcome) {
  const auto published = static_cast<double>(outcome.replay.published_stamps_ns.size());
  return std::to_string(outcome.replay.published_stamps_ns.size()) + " scans published in " +
         fixed(outcome.replay.seconds, 1) + " s (" + fixed(published / outcome.replay.seconds, 1) +
         "/s), " + (outcome.replay.acknowledged ? "all" : "not all") + " acknowledged, " +
         std::to_string(outcome.replay.skipped.size()) + " damaged ones left out\n" +
         "the server mapped " + std::to_string(outcome.server.mapped) + " and dropped " +
         std::to_string(outcome.server.dropped) + "; " + std::to_string(outcome.poses.size()) +
         " poses came back\n";
}

ExitCode run(const Arguments& arguments) {
  StopSignal stop;
  const ReplayOutcome outcome = replay(arguments, stop);
  if (!arguments.out.empty()) write_poses_as_named(arguments.out, outcome.poses);
  std::cout << (arguments.json ? to_json(outcome).dump(2) + "\n" : describe(outcome));
  if (!arguments.json && !arguments.out.empty()) {
    std::cout << "poses written to " << arguments.out
              << " (lidar frame; the map is the lidar frame of the server's first scan)\n";
  }
  const std::size_t published = outcome.replay.published_stamps_ns.size();
  const bool complete = outcome.server.mapped >= published && outcome.poses.size() == published;
  if (arguments.lossless && !complete && !outcome.replay.stopped) {
    std::cerr << "stillmap: the replay was to be lossless, but the server mapped "
              << outcome.server.mapped << " of " << published << " scans, and "
              << outcome.poses.size()
              << " poses came back; 'stillmap status' counts why. A server takes no scan twice: "
                 "'stillmap reset' makes it begin anew\n";
    return ExitCode::failed;
  }
  return outcome.replay.stopped ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_replay_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  ReplayOptions& replay = arguments->replay;
  CommandHandle command =
      program.command("replay", "Publish a recording on DDS, as a lidar driver would");
  command.option("DATASET", arguments->dataset, dataset_kinds).required();
  command.option("--topic-in", arguments->topic_in, topic_in_help);
  command
      .option("--rate", arguments->rate,
              "Times real time; default 1, with --lossless as fast as the server takes them")
      .above_zero();
  command.flag("--lossless", arguments->lossless,
               "Wait for the server instead of letting it drop scans (its input delivery "
               "must be 'every')");
  command.option("--out", arguments->out,
                 "Write the poses that came back: KITTI 3x4, or with stamps to FILE.tum");
  command.option("--start", replay.range.first, "Number of the first scan");
  command.option("--scans,--count", replay.range.count, "Take as many scans at most");
  command.flag("--labels,!--no-labels", replay.with_labels,
               "Send the recording's labels, where it has any (default)");
  command.flag("--strict", replay.range.strict, "Stop at the first damaged file");
  command.option("--topic", arguments->topic, "ROS 2 name of the topic").with_default();
  command
      .option("--subscribers", arguments->subscribers,
              "Begin when so many take the scans: the server, and 'stillmap record', say")
      .between(1, 1000)
      .with_default();
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap replay sequences/00 --rate 2\n"
      "  stillmap replay city --lossless --out poses_lidar.txt\n"
      "Ends when the server has worked off what was sent, and says what became of it. Exit code 1\n"
      "when a lossless replay lost something, 3 when no server answers or it stops taking scans.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
