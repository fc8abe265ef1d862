#include "clients/commands/live/recorder.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

#include "idl/bag/bag_writer.hpp"
#include "idl/dds/serialized_sample.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "octomap_msgs.h"
#include "sensor_msgs.h"
#include "stillmap_msgs.h"
#include "tf2_msgs.h"

namespace stillmap::cli {
namespace {

using eprosima::fastdds::dds::SampleInfo;
using eprosima::fastdds::dds::TypeSupport;
using eprosima::fastrtps::rtps::GUID_t;

/// Samples that may wait while the disk is busy, and of each key on a keyed topic.
constexpr int max_waiting = 20;
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
  std::vector<RecordableTopic> topics{
      recordable(dds::points_topic(options.points_topic, DeliveryMode::latest, max_waiting)),
      recordable(dds::odometry_prior_topic(options.odometry_topic))};
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
                                  known);
    }
    chosen.push_back(*found);
  }
  return chosen;
}

std::vector<dds::BagTopic> bag_topics(const std::vector<RecordableTopic>& topics) {
  std::vector<dds::BagTopic> in_bag;
  for (const RecordableTopic& topic : topics) {
    const dds::TopicQos& qos = topic.offered;
    in_bag.push_back({.name = ros_name(topic),
                      .type = dds::ros_type_name(topic.type),
                      .serialization_format = "cdr",
                      .offered_qos_profiles =
                          dds::offered_qos_yaml(qos.reliable, qos.transient_local, qos.depth),
                      .messages = 0});
  }
  return in_bag;
}

dds::TopicQos reader_qos_for(const RecordableTopic& topic, bool as_offered) {
  dds::TopicQos qos = topic.offered;
  qos.keep_all = false;
  qos.depth = qos.max_keys > 1 ? max_waiting_per_key : max_waiting;
  // Publishers that promise less are recorded too, with what they promise.
  qos.reliable = as_offered;
  qos.transient_local = as_offered && qos.transient_local;
  return qos;
}

/// Finds gaps in the numbers that writers give to their samples.
class LossCounter {
 public:
  void add(const GUID_t& writer, std::uint64_t number) {
    const auto [last, is_new] = last_.try_emplace(writer, number);
    if (is_new) return;
    if (number > last->second + 1) lost_ += number - last->second - 1;
    last->second = std::max(last->second, number);
  }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  std::map<GUID_t, std::uint64_t> last_;
  std::uint64_t lost_ = 0;
};

std::int64_t wall_clock_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

/// A topic that is being recorded.
class Input {
 public:
  Input(dds::Participant& participant, RecordableTopic topic)
      : participant_(participant), topic_(std::move(topic)) {
    listen(true);
  }

  /// Asks for what any publisher gives, once one gives less than was asked for.
  void relax_qos() {
    if (!as_offered_ || reader_->events().incompatible_writers() == 0) return;
    reader_.reset();
    listen(false);
  }

  [[nodiscard]] bool take(dds::SerializedSample& sample) {
    SampleInfo info;
    if (!reader_->take(sample, info, {}, std::chrono::milliseconds(0))) return false;
    const auto& number = info.sample_identity.sequence_number();
    losses_.add(info.sample_identity.writer_guid(), number.to64long());
    return true;
  }

  [[nodiscard]] std::uint64_t lost() const {
    return topic_.offered.transient_local ? 0 : losses_.lost();
  }
  [[nodiscard]] int publishers() const { return reader_->events().matched_writers(); }

 private:
  void listen(bool as_offered) {
    as_offered_ = as_offered;
    reader_.emplace(participant_, topic_.dds_name, topic_.type, reader_qos_for(topic_, as_offered));
  }

  dds::Participant& participant_;
  RecordableTopic topic_;
  std::optional<dds::SerializedSampleReader> reader_;
  bool as_offered_ = true;
  LossCounter losses_;
};

}  // namespace

struct Recorder::Connection {
  Connection(const RecorderOptions& options, const std::vector<RecordableTopic>& topics)
      : participant(options.dds), bag(options.folder, bag_topics(topics)) {
    for (const RecordableTopic& topic : topics) {
      inputs.push_back(std::make_unique<Input>(participant, topic));
    }
  }

  dds::Participant participant;
  dds::BagWriter bag;
  std::vector<std::unique_ptr<Input>> inputs;
};

Recorder::Recorder(const RecorderOptions& options)
    : connection_(std::make_unique<Connection>(options, chosen_topics(options))) {}
Recorder::~Recorder() = default;

void Recorder::write_received() {
  dds::SerializedSample sample;
  for (std::size_t i = 0; i < connection_->inputs.size(); ++i) {
    Input& input = *connection_->inputs[i];
    input.relax_qos();
    // One topic that never pauses does not starve the others.
    for (int taken = 0; taken < max_waiting && input.take(sample); ++taken) {
      connection_->bag.add(i, wall_clock_ns(), sample);
    }
  }
}

void Recorder::commit() { connection_->bag.commit(); }
void Recorder::finish() { connection_->bag.finish(); }

std::vector<RecordedTopic> Recorder::topics() const {
  std::vector<RecordedTopic> topics;
  for (std::size_t i = 0; i < connection_->inputs.size(); ++i) {
    const dds::BagTopic& topic = connection_->bag.topics()[i];
    topics.push_back({.name = topic.name,
                      .messages = topic.messages,
                      .lost = connection_->inputs[i]->lost(),
                      .publishers = connection_->inputs[i]->publishers()});
  }
  return topics;
}

std::uint64_t Recorder::messages() const { return connection_->bag.messages(); }
std::uint64_t Recorder::bytes() const { return connection_->bag.bytes(); }

std::uint64_t Recorder::lost() const {
  std::uint64_t lost = 0;
  for (const auto& input : connection_->inputs) lost += input->lost();
  return lost;
}

}  // namespace stillmap::cli
