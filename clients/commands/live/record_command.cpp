#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/topic_name.hpp"
#include "idl/bag/bag_writer.hpp"
#include "idl/dds/dds_options.hpp"
#include "idl/dds/message_definition.hpp"
#include "idl/dds/sample_losses.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "idl/interface/topics.hpp"
#include "initial_pose.h"
#include "nav_msgs.h"
#include "octomap_msgs.h"
#include "sensor_msgs.h"
#include "stillmap_msgs.h"
#include "submaps.h"
#include "tf2_msgs.h"

namespace stillmap::cli {
namespace {

struct RecorderOptions {
  dds::DdsOptions dds;
  /// First part of the server's topic names.
  std::string server_name = "stillmap";
  /// The sensor's topic, or those of several lidars, and that of the odometry.
  std::vector<std::string> points_topics{"points"};
  std::string odometry_topic = "odom_prior";
  std::string imu_topic = "imu/data";
  std::string gnss_topic = "fix";
  std::string initial_pose_topic = "initialpose";
  /// ROS 2 names to record; empty: all topics of the sensor and the server.
  std::vector<std::string> topics;
  /// New folder of the bag.
  std::filesystem::path folder;
  dds::BagFormat format = dds::BagFormat::sqlite;
  dds::mcap::Compression compression = dds::mcap::Compression::none;
};

struct RecordedTopic {
  std::string name;
  std::uint64_t messages = 0;
  /// Gaps in the sequence numbers of the writers. Not counted on latched topics (transient local),
  /// where newer samples may replace older ones.
  std::uint64_t lost = 0;
  /// Publishers matched now.
  int publishers = 0;
};

using Clock = std::chrono::steady_clock;
using eprosima::fastdds::dds::SampleInfo;
using eprosima::fastdds::dds::TypeSupport;

/// Reader depth, for when the disk is busy; on a keyed topic for each key.
constexpr int max_waiting = 20;
/// Of small samples that come often.
constexpr int max_waiting_often = 500;
constexpr int max_waiting_per_key = 4;

struct RecordableTopic {
  std::string dds_name;
  TypeSupport type;
  dds::TopicQos offered;
};

template <typename T>
RecordableTopic recordable(const dds::TopicSpec<T>& topic) {
  return {.dds_name = topic.dds_name, .type = dds::type_support<T>(), .offered = topic.writer};
}

std::vector<RecordableTopic> recordable_topics(const RecorderOptions& options) {
  std::vector<RecordableTopic> topics;
  for (const std::string& points : options.points_topics) {
    topics.push_back(recordable(dds::points_topic(points, DeliveryMode::latest, max_waiting)));
  }
  topics.push_back(recordable(dds::odometry_prior_topic(options.odometry_topic)));
  topics.push_back(recordable(dds::imu_topic(options.imu_topic, DeliveryMode::latest)));
  topics.push_back(recordable(dds::gnss_topic(options.gnss_topic, DeliveryMode::latest)));
  topics.push_back(recordable(dds::initial_pose_topic(options.initial_pose_topic)));
  dds::for_each_topic(dds::Topics::in(options.server_name),
                      [&](const auto& topic) { topics.push_back(recordable(topic)); });
  return topics;
}

/// "/points" of "rt/points".
std::string ros_name(const RecordableTopic& topic) { return topic.dds_name.substr(2); }

std::vector<RecordableTopic> chosen_topics(const RecorderOptions& options) {
  std::vector<RecordableTopic> all = recordable_topics(options);
  if (options.topics.empty()) return all;
  std::vector<RecordableTopic> chosen;
  for (const std::string& requested : options.topics) {
    const std::string name = requested.starts_with('/') ? requested : "/" + requested;
    const auto found = std::ranges::find(all, name, ros_name);
    if (found == all.end()) {
      std::string known;
      for (const RecordableTopic& topic : all) known.append(" ").append(ros_name(topic));
      throw std::invalid_argument("topic '" + requested + "' cannot be recorded; there are" +
                                  known + "; --points names those of lidars");
    }
    const bool is_new =
        std::ranges::find(chosen, found->dds_name, &RecordableTopic::dds_name) == chosen.end();
    if (is_new) chosen.push_back(*found);
  }
  return chosen;
}

std::vector<dds::BagTopic> bag_topics(const std::vector<RecordableTopic>& topics) {
  std::vector<dds::BagTopic> in_bag;
  for (const RecordableTopic& topic : topics) {
    const dds::TopicQos& qos = topic.offered;
    const std::string type = dds::ros_type_name(topic.type);
    in_bag.push_back({.name = ros_name(topic),
                      .type = type,
                      .serialization_format = "cdr",
                      .offered_qos_profiles =
                          dds::offered_qos_yaml(qos.reliable, qos.transient_local, qos.depth),
                      .messages = 0,
                      .definition = dds::message_definition(type)});
  }
  return in_bag;
}

dds::TopicQos reader_qos_for(const RecordableTopic& topic) {
  dds::TopicQos qos = topic.offered;
  qos.keep_all = false;
  qos.depth = qos.max_keys > 1 ? max_waiting_per_key
                               : std::clamp(qos.depth, max_waiting, max_waiting_often);
  // Publishers that offer less are recorded, too.
  qos.accept_best_effort = true;
  return qos;
}

std::int64_t wall_clock_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

/// A topic that is being recorded.
class Input {
 public:
  Input(dds::Participant& participant, RecordableTopic topic)
      : topic_(std::move(topic)),
        reader_(participant, topic_.dds_name, topic_.type, reader_qos_for(topic_)) {}

  [[nodiscard]] bool take(dds::SerializedSample& sample) {
    SampleInfo info;
    if (!reader_.take(sample, info, {}, std::chrono::milliseconds(0))) return false;
    losses_.add(info.sample_identity);
    return true;
  }

  [[nodiscard]] std::uint64_t lost() const {
    return topic_.offered.transient_local ? 0 : losses_.lost();
  }
  [[nodiscard]] int publishers() const { return reader_.matched_writers(); }

 private:
  RecordableTopic topic_;
  dds::SerializedSampleReader reader_;
  dds::SampleLosses losses_;
};

/// Writes serialized samples from DDS to a rosbag2 without decoding them. Samples wait in the
/// readers, whose depth is bounded: a caller that writes too rarely loses samples, which are
/// counted. Not thread safe.
class Recorder {
 public:
  /// Joins the domain and makes the bag. Throws DdsError, DatasetError for a folder that exists
  /// already, std::invalid_argument for a topic that cannot be recorded.
  explicit Recorder(const RecorderOptions& options) : Recorder(options, chosen_topics(options)) {}

  /// Writes what has arrived. Returns whether more may be waiting. Throws DatasetError when it
  /// cannot.
  bool write_received() {
    dds::SerializedSample sample;
    bool has_more = false;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      Input& input = *inputs_[i];
      // Bounded, so that a topic that never pauses does not starve the others.
      int taken = 0;
      for (; taken < max_waiting && input.take(sample); ++taken) {
        bag_.add(i, wall_clock_ns(), sample);
      }
      has_more |= taken == max_waiting;
    }
    return has_more;
  }
  /// Commits to the disk.
  void commit() { bag_.commit(); }
  /// The last commit; leaves a bag in one plain file.
  void finish() { bag_.finish(); }

  [[nodiscard]] std::vector<RecordedTopic> topics() const {
    std::vector<RecordedTopic> topics;
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const dds::BagTopic& topic = bag_.topics()[i];
      topics.push_back({.name = topic.name,
                        .messages = topic.messages,
                        .lost = inputs_[i]->lost(),
                        .publishers = inputs_[i]->publishers()});
    }
    return topics;
  }
  [[nodiscard]] std::uint64_t messages() const { return bag_.messages(); }
  [[nodiscard]] std::uint64_t bytes() const { return bag_.bytes(); }
  [[nodiscard]] std::uint64_t lost() const {
    std::uint64_t lost = 0;
    for (const auto& input : inputs_) lost += input->lost();
    return lost;
  }

 private:
  Recorder(const RecorderOptions& options, const std::vector<RecordableTopic>& topics)
      : participant_(options.dds),
        bag_(options.folder, bag_topics(topics), options.format, options.compression) {
    for (const RecordableTopic& topic : topics) {
      inputs_.push_back(std::make_unique<Input>(participant_, topic));
    }
  }

  dds::Participant participant_;
  dds::BagWriter bag_;
  std::vector<std::unique_ptr<Input>> inputs_;
};

constexpr std::chrono::milliseconds record_poll_period{5};
/// A killed run loses no more than this.
constexpr std::chrono::seconds commit_period{1};
constexpr double bytes_a_mib = 1048576.0;

struct RecordArguments {
  RecorderOptions recorder;
  std::string out;
  std::string format = "sqlite";
  /// Empty: that of the format.
  std::string compression;
  ClientArguments client;
  /// 0: until it is stopped.
  double seconds = 0.0;
  bool json = false;
};

dds::mcap::Compression compression_named(const std::string& name) {
  using dds::mcap::Compression;
  if (name == "none") return Compression::none;
  return name == "zstd" ? Compression::zstd : Compression::lz4;
}

RecorderOptions recorder_options(const RecordArguments& arguments) {
  const std::string fault = topic_list_fault(arguments.recorder.points_topics);
  if (!fault.empty()) throw std::invalid_argument("--points " + fault);
  RecorderOptions options = arguments.recorder;
  options.dds = arguments.client.dds(DdsRole::sensor);
  options.server_name = arguments.client.server_name;
  options.folder = arguments.out;
  if (arguments.format == "mcap") {
    options.format = dds::BagFormat::mcap;
    options.compression = compression_named(arguments.compression);
  } else if (!arguments.compression.empty()) {
    throw std::invalid_argument("--compression is of MCAP alone: add --format mcap");
  }
  return options;
}

std::string progress_note(const Recorder& recorder) {
  std::string note = fixed(static_cast<double>(recorder.bytes()) / bytes_a_mib, 1) + " MiB";
  if (recorder.lost() > 0) note += ", " + std::to_string(recorder.lost()) + " lost";
  return note;
}

void record(Recorder& recorder, const RecordArguments& arguments, StopSignal& stop) {
  Progress progress("record", "messages", 0);
  const auto began = Clock::now();
  auto committed = began;
  const auto over = [&] {
    const std::chrono::duration<double> passed = Clock::now() - began;
    return arguments.seconds > 0.0 && passed.count() >= arguments.seconds;
  };
  while (!stop.wait_for(record_poll_period) && !over()) {
    static_cast<void>(recorder.write_received());
    if (Clock::now() - committed < commit_period) continue;
    recorder.commit();
    committed = Clock::now();
    progress.update(recorder.messages(), progress_note(recorder));
  }
  // What waits; not what a sensor that goes on sends meanwhile.
  constexpr int max_rounds = 1 + max_waiting_often / max_waiting;
  for (int round = 0; round < max_rounds && recorder.write_received(); ++round) {
  }
  recorder.finish();
}

Json to_json(const Recorder& recorder, const std::string& folder) {
  Json topics = Json::array();
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

ExitCode run(const RecordArguments& arguments) {
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
  auto arguments = std::make_shared<RecordArguments>();
  CommandHandle command =
      program.command("record", "Record the sensor's and the server's topics to a ROS 2 bag");
  command.option("OUT", arguments->out, "New folder for the bag").required();
  command.option("--format", arguments->format, "How the bag is stored")
      .one_of({"sqlite", "mcap"})
      .with_default();
  command.option("--compression", arguments->compression, "Of MCAP's chunks; default: lz4")
      .one_of({"none", "lz4", "zstd"});
  command.option("--topics", arguments->recorder.topics,
                 "ROS 2 names of the topics to record; default: all of the sensor and the server");
  command.option("--for", arguments->seconds, "Stop after so many seconds; default: at Ctrl-C")
      .above_zero();
  command
      .option("--points", arguments->recorder.points_topics,
              "The sensor's topic; of several lidars, each one's")
      .corrected(to_topic_name)
      .with_default();
  command.option("--odometry", arguments->recorder.odometry_topic, "The odometry prior's topic")
      .corrected(to_topic_name)
      .with_default();
  command.option("--imu", arguments->recorder.imu_topic, "The IMU's topic")
      .corrected(to_topic_name)
      .with_default();
  command.option("--gnss", arguments->recorder.gnss_topic, "A GNSS receiver's topic")
      .corrected(to_topic_name)
      .with_default();
  command
      .option("--initial-pose", arguments->recorder.initial_pose_topic,
              "The topic on which operators say where the robot is")
      .corrected(to_topic_name)
      .with_default();
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap record tour\n"
      "  stillmap record tour --for 60 --topics points stillmap/odometry tf\n"
      "  stillmap record tour --points front/points rear/points     # several lidars\n"
      "  stillmap replay tour --topic-in points\n"
      "  stillmap record tour --format mcap    # for Foxglove, Lichtblick, and ROS 2 from Iron on\n"
      "Writes what DDS carried, byte for byte, as ROS 2 Humble's rosbag2 in SQLite storage or as\n"
      "MCAP: 'ros2 bag info' and 'ros2 bag play' read it. A run that is killed keeps what it had\n"
      "a second before. Samples that were lost on the way or for a slow disk are counted.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
