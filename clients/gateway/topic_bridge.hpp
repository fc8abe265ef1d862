#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "clients/gateway/foxglove_protocol.hpp"
#include "clients/gateway/message.hpp"
#include "clients/gateway/post.hpp"
#include "idl/dds/participant.hpp"
#include "idl/dds/type_support.hpp"

namespace stillmap::gateway {

/// Which topics there are, as ROS 2 names.
struct TopicChoice {
  /// First part of the server's.
  std::string server_name = "stillmap";
  std::string points = "points";
  std::string odometry_prior = "odom_prior";
  std::string imu = "imu/data";
  std::string gnss = "fix";
};

/// Which waiting message a newer one replaces.
enum class Replaces {
  /// The last one of the topic.
  last,
  /// The last one of the same key: a tile.
  of_key,
  /// The last one of the same publisher: each node's transforms.
  of_publisher,
  /// None.
  none
};

/// A topic that is forwarded.
struct ForwardedTopic {
  std::string dds_name;
  eprosima::fastdds::dds::TypeSupport type;
  dds::TopicQos qos;
  Replaces replaces = Replaces::last;
  /// Messages that may wait for a client.
  std::size_t max_waiting = 1;
};

/// All topics of the server and its sensors.
[[nodiscard]] std::vector<ForwardedTopic> forwarded_topics(const TopicChoice& choice);

/// Gets what is sent on topics.
class TopicListener {
 public:
  virtual ~TopicListener() = default;
  virtual void message_arrived(std::uint32_t subscription, const MessagePtr& message) = 0;
  /// The topic cannot be read, and why.
  virtual void topic_failed(std::uint32_t subscription, const std::string& why) = 0;
};

/// Reads topics while somebody listens, each in a thread of its own, and hands every sample to all
/// listeners without decoding or copying it. A reader waits until its sample is handed on: what
/// comes faster waits in DDS, newest only. Who listens to a latched topic gets its last samples
/// first. A topic has one reader at most: who listens again while it still goes waits for the next,
/// so that coming and going in a loop costs one thread. One thread uses it, that of `post`.
class TopicBridge {
 public:
  TopicBridge(dds::Participant& participant, const TopicChoice& choice, Post post);
  ~TopicBridge();
  TopicBridge(const TopicBridge&) = delete;
  TopicBridge& operator=(const TopicBridge&) = delete;

  /// Channel ids count from 1.
  [[nodiscard]] const std::vector<ChannelInfo>& channels() const { return infos_; }
  [[nodiscard]] bool has(std::uint32_t channel) const {
    return channel >= 1 && channel <= infos_.size();
  }
  [[nodiscard]] const ForwardedTopic& topic(std::uint32_t channel) const;

  void listen(std::uint32_t channel, TopicListener& listener, std::uint32_t subscription);
  void stop_listening(std::uint32_t channel, const TopicListener& listener,
                      std::uint32_t subscription);

 private:
  class Reading;
  /// The last samples of a latched topic, for who comes later.
  struct Latched {
    std::deque<std::string> order;
    std::unordered_map<std::string, MessagePtr> newest;
    std::size_t bytes = 0;
    void add(const MessagePtr& message);
  };
  struct Listener {
    TopicListener* listener = nullptr;
    std::uint32_t subscription = 0;
  };
  struct Channel {
    ForwardedTopic topic;
    std::vector<Listener> listeners;
    Latched latched;
    std::unique_ptr<Reading> reading;
    /// Nobody listened any more; its thread ends.
    bool is_stopping = false;
  };

  void begin_reading(std::uint32_t channel);
  void deliver(std::uint32_t channel, const MessagePtr& message);
  void reading_ended(std::uint32_t channel, const std::string& why);

  dds::Participant& participant_;
  Post post_;
  std::vector<ChannelInfo> infos_;
  std::vector<Channel> channels_;
};

}  // namespace stillmap::gateway
