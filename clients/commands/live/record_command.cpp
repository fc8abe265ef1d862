#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/live/recorder.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds poll_period{5};
/// A run that is killed loses no more than this.
constexpr std::chrono::seconds commit_period{1};
constexpr double bytes_a_mib = 1048576.0;

struct Arguments {
  RecorderOptions recorder;
  std::string out;
  ClientArguments client;
  /// 0: until it is stopped.
  double seconds = 0.0;
  bool json = false;
};

RecorderOptions recorder_options(const Arguments& arguments) {
  RecorderOptions options = arguments.recorder;
  options.dds = arguments.client.dds(DdsRole::sensor);
  options.server_name = arguments.client.server_name;
  options.folder = arguments.out;
  return options;
}

std::string progress_note(const Recorder& recorder) {
  std::string note = fixed(static_cast<double>(recorder.bytes()) / bytes_a_mib, 1) + " MiB";
  if (recorder.lost() > 0) note += ", " + std::to_string(recorder.lost()) + " lost";
  return note;
}

void record(Recorder& recorder, const Arguments& arguments, StopSignal& stop) {
  Progress progress("record", "messages", 0);
  const auto began = Clock::now();
  auto committed = began;
  const auto over = [&] {
    const std::chrono::duration<double> passed = Clock::now() - began;
    return arguments.seconds > 0.0 && passed.count() >= arguments.seconds;
  };
  while (!stop.wait_for(poll_period) && !over()) {
    recorder.write_received();
    if (Clock::now() - committed < commit_period) continue;
    recorder.commit();
    committed = Clock::now();
    progress.update(recorder.messages(), progress_note(recorder));
  }
  recorder.write_received();
  recorder.finish();
}

nlohmann::json to_json(const Recorder& recorder, const std::string& folder) {
  nlohmann::json topics = nlohmann::json::array();
  for (const RecordedTopic& topic : recorder.topics()) {
    topics.push_back({{"name", topic.name},
                      {"messages", topic.messages},
                      {"lost", topic.lost},
                      {"publishers", topic.publishers}});
  }
  return {{"bag", folder},
          {"messages", recorder.messages()},
          {"bytes", recorder.bytes()},
          {"lost", recorder.lost()},
          {"topics", topics}};
}

std::string describe(const Recorder& recorder, const std::string& folder) {
  std::string text = folder + ": " + std::to_string(recorder.messages()) + " messages, " +
                     progress_note(recorder) + "\n";
  for (const RecordedTopic& topic : recorder.topics()) {
    text.append("  ").append(topic.name).append(": ").append(std::to_string(topic.messages));
    if (topic.lost > 0) text.append(" (").append(std::to_string(topic.lost)).append(" lost)");
    if (topic.publishers == 0 && topic.messages == 0) text.append(" (nobody publishes it)");
    text.append("\n");
  }
  return text;
}

ExitCode run(const Arguments& arguments) {
  StopSignal stop;
  Recorder recorder(recorder_options(arguments));
  record(recorder, arguments, stop);
  std::cout << (arguments.json ? to_json(recorder, arguments.out).dump(2) + "\n"
                               : describe(recorder, arguments.out));
  if (recorder.messages() > 0) return ExitCode::ok;
  std::cerr << "stillmap: nothing was recorded: no topic had a message in DDS domain "
            << arguments.client.domain << "; is it the right one (--domain)?\n";
  return ExitCode::failed;
}

}  // namespace

void add_record_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command =
      program.command("record", "Record the sensor's and the server's topics to a ROS 2 bag");
  command.option("OUT", arguments->out, "New folder for the bag").required();
  command.option("--topics", arguments->recorder.topics,
                 "ROS 2 names of the topics to record; default: all of the sensor and the server");
  command.option("--for", arguments->seconds, "Stop after so many seconds; default: at Ctrl-C")
      .above_zero();
  command.option("--points", arguments->recorder.points_topic, "The sensor's topic").with_default();
  command.option("--odometry", arguments->recorder.odometry_topic, "The odometry prior's topic")
      .with_default();
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap record drive\n"
      "  stillmap record drive --for 60 --topics points stillmap/odometry tf\n"
      "  stillmap replay drive --topic-in points\n"
      "Writes what DDS carried, byte for byte, as ROS 2 Humble's rosbag2 in SQLite storage:\n"
      "'ros2 bag info' and 'ros2 bag play' read it. A run that is killed keeps what it had a\n"
      "second before. Samples that were lost on the way or for a slow disk are counted.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
