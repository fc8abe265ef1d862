#include "clients/gateway/topic_bridge.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <optional>
#include <semaphore>
#include <thread>
#include <utility>

#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "octomap_msgs.h"
#include "sensor_msgs.h"
#include "stillmap_msgs.h"
#include "submaps.h"
#include "tf2_msgs.h"

namespace stillmap::gateway {
namespace {

using eprosima::fastdds::dds::SampleInfo;

/// Transforms that may wait: they come in pairs, neither of which replaces the other.
constexpr std::size_t max_waiting_transforms = 16;
constexpr std::size_t max_static_transforms = 100;
/// Of tiles, newest only.
constexpr std::size_t max_waiting_tiles = 200'000;
/// Of one topic's last samples; the oldest go first.
constexpr std::size_t max_latched_bytes = 256U << 20U;
/// How often a reader that waits looks whether it is still wanted.
constexpr std::chrono::milliseconds stop_check_period(50);
constexpr int max_waiting_in_reader = 10;

template <typename T>
ForwardedTopic forwarded(const dds::TopicSpec<T>& topic) {
  return {.dds_name = topic.dds_name, .type = dds::type_support<T>(), .qos = topic.writer};
}

/// Sensors do not wait for us, whatever they offer.
template <typename T>
ForwardedTopic sensor_topic(const dds::TopicSpec<T>& topic) {
  ForwardedTopic made = forwarded(topic);
  made.qos = {.reliable = false, .depth = 1};
  return made;
}

void refine(const dds::Topics& names, ForwardedTopic& topic) {
  if (topic.dds_name == names.tf.dds_name) {
    topic.replaces = Replaces::none;
    topic.max_waiting = max_waiting_transforms;
  } else if (topic.dds_name == names.tf_static.dds_name) {
    topic.replaces = Replaces::of_publisher;
    topic.max_waiting = max_static_transforms;
    topic.qos = names.tf_static.reader;
  } else if (topic.qos.max_keys > 1) {
    topic.replaces = Replaces::of_key;
    topic.max_waiting = max_waiting_tiles;
  }
}

std::int64_t wall_clock_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

std::string key_of(Replaces replaces, const SampleInfo& info, std::uint64_t number) {
  switch (replaces) {
    case Replaces::last:
      break;
    case Replaces::of_key:
      return {reinterpret_cast<const char*>(&info.instance_handle), sizeof(info.instance_handle)};
    case Replaces::of_publisher: {
      const auto& writer = info.sample_identity.writer_guid();
      return {reinterpret_cast<const char*>(&writer), sizeof(writer)};
    }
    case Replaces::none:
      return std::to_string(number);
  }
  return {};
}

}  // namespace

std::vector<ForwardedTopic> forwarded_topics(const TopicChoice& choice) {
  const dds::Topics names = dds::Topics::in(choice.server_name);
  std::vector<ForwardedTopic> topics;
  dds::for_each_topic(names, [&](const auto& topic) { topics.push_back(forwarded(topic)); });
  for (ForwardedTopic& topic : topics) refine(names, topic);
  topics.push_back(sensor_topic(dds::points_topic(choice.points, DeliveryMode::latest, 1)));
  topics.push_back(sensor_topic(dds::odometry_prior_topic(choice.odometry_prior)));
  topics.push_back(sensor_topic(dds::imu_topic(choice.imu, DeliveryMode::latest)));
  topics.push_back(sensor_topic(dds::gnss_topic(choice.gnss, DeliveryMode::latest)));
  return topics;
}

/// A reader and its thread, in which it is made and goes.
class TopicBridge::Reading {
 public:
  struct Events {
    /// Calls its argument's `done` once the message is handed on.
    std::function<void(MessagePtr, std::function<void()> done)> arrived;
    /// Nothing more comes. The reason is empty where it was told to stop.
    std::function<void(std::string)> ended;
  };

  Reading(dds::Participant& participant, const ForwardedTopic& topic, Events events)
      : participant_(participant),
        topic_(topic),
        events_(std::move(events)),
        thread_([this](const std::stop_token& stop) { run(stop); }) {}

  void request_stop() { thread_.request_stop(); }

 private:
  void run(const std::stop_token& stop) {
    std::string fault;
    try {
      read(stop);
    } catch (const std::exception& error) {
      fault = error.what();
    }
    events_.ended(std::move(fault));
  }

  /// As offered by the server; publishers that offer less are read, too, with the weakest request.
  [[nodiscard]] dds::TopicQos reader_qos() const {
    dds::TopicQos qos = topic_.qos;
    qos.keep_all = false;
    if (topic_.replaces == Replaces::last) qos.depth = 1;
    qos.depth = std::min(qos.depth, topic_.replaces == Replaces::of_publisher
                                        ? static_cast<int>(max_static_transforms)
                                        : max_waiting_in_reader);
    // Publishers that offer less are forwarded, too.
    qos.accept_best_effort = true;
    return qos;
  }

  void read(const std::stop_token& stop) {
    dds::SerializedSampleReader reader(participant_, topic_.dds_name, topic_.type, reader_qos());
    SampleInfo info;
    for (std::uint64_t number = 0; !stop.stop_requested();) {
      auto message = std::make_shared<Message>();
      if (!reader.take(message->bytes, info, stop, std::chrono::seconds(1))) continue;
      message->received_ns = wall_clock_ns();
      message->key = key_of(topic_.replaces, info, ++number);
      hand_on(std::move(message), stop);
    }
  }

  void hand_on(MessagePtr message, const std::stop_token& stop) const {
    const auto handed_on = std::make_shared<std::binary_semaphore>(0);
    events_.arrived(std::move(message), [handed_on] { handed_on->release(); });
    while (!stop.stop_requested() && !handed_on->try_acquire_for(stop_check_period)) {
    }
  }

  dds::Participant& participant_;
  ForwardedTopic topic_;
  Events events_;
  std::jthread thread_;
};

void TopicBridge::Latched::add(const MessagePtr& message) {
  const auto [place, is_new] = newest.try_emplace(message->key, message);
  bytes += message->bytes.size();
  if (is_new) {
    order.push_back(message->key);
  } else {
    bytes -= place->second->bytes.size();
    place->second = message;
  }
  while (bytes > max_latched_bytes && order.size() > 1) {
    const auto oldest = newest.find(order.front());
    bytes -= oldest->second->bytes.size();
    newest.erase(oldest);
    order.pop_front();
  }
}

TopicBridge::TopicBridge(dds::Participant& participant, const TopicChoice& choice, Post post)
    : participant_(participant), post_(std::move(post)) {
  std::uint32_t id = 0;
  for (ForwardedTopic& topic : forwarded_topics(choice)) {
    constexpr std::string_view ros_prefix = "rt";
    infos_.push_back({.id = ++id,
                      .topic = topic.dds_name.substr(ros_prefix.size()),
                      .type = dds::ros_type_name(topic.type)});
    channels_.emplace_back().topic = std::move(topic);
  }
}

TopicBridge::~TopicBridge() {
  for (Channel& channel : channels_) {
    if (channel.reading) channel.reading->request_stop();
  }
}

const ForwardedTopic& TopicBridge::topic(std::uint32_t channel) const {
  return channels_.at(channel - 1).topic;
}

void TopicBridge::listen(std::uint32_t id, TopicListener& listener, std::uint32_t subscription) {
  Channel& channel = channels_.at(id - 1);
  channel.listeners.push_back({&listener, subscription});
  for (const std::string& key : channel.latched.order) {
    listener.message_arrived(subscription, channel.latched.newest.at(key));
  }
  if (!channel.reading) begin_reading(id);
}

void TopicBridge::begin_reading(std::uint32_t id) {
  Channel& channel = channels_.at(id - 1);
  channel.is_stopping = false;
  channel.reading = std::make_unique<Reading>(
      participant_, channel.topic,
      Reading::Events{.arrived =
                          [this, id](MessagePtr message, std::function<void()> done) {
                            post_([this, id, message = std::move(message), done = std::move(done)] {
                              deliver(id, message);
                              done();
                            });
                          },
                      .ended =
                          [this, id](std::string why) {
                            post_([this, id, why = std::move(why)] { reading_ended(id, why); });
                          }});
}

void TopicBridge::stop_listening(std::uint32_t id, const TopicListener& listener,
                                 std::uint32_t subscription) {
  Channel& channel = channels_.at(id - 1);
  std::erase_if(channel.listeners, [&](const Listener& entry) {
    return entry.listener == &listener && entry.subscription == subscription;
  });
  if (!channel.listeners.empty()) return;
  channel.latched = {};
  if (!channel.reading) return;
  channel.reading->request_stop();
  channel.is_stopping = true;
}

void TopicBridge::deliver(std::uint32_t id, const MessagePtr& message) {
  Channel& channel = channels_.at(id - 1);
  // The last one may have gone meanwhile, and others come who get theirs from the next reader.
  if (channel.is_stopping) return;
  if (channel.topic.qos.transient_local) channel.latched.add(message);
  for (const Listener& entry : channel.listeners) {
    entry.listener->message_arrived(entry.subscription, message);
  }
}

void TopicBridge::reading_ended(std::uint32_t id, const std::string& why) {
  Channel& channel = channels_.at(id - 1);
  const bool was_stopped = channel.is_stopping;
  channel.reading = nullptr;
  if (was_stopped) {
    if (!channel.listeners.empty()) begin_reading(id);
    return;
  }
  // Whoever listens next tries again.
  for (const Listener& entry : channel.listeners) {
    entry.listener->topic_failed(entry.subscription, why);
  }
}

}  // namespace stillmap::gateway
