#pragma once

#include <fastdds/rtps/common/Guid.h>

#include <chrono>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "idl/dds/remote_participant.hpp"
#include "idl/dds/ros_gids.hpp"
#include "idl/dds/topic_qos.hpp"

namespace stillmap::dds {

/// What discovery knows of the domain: participants, their endpoints, and which security keeps from
/// us; and our own endpoints. Thread-safe.
class DiscoveryMonitor : public eprosima::fastdds::dds::DomainParticipantListener {
 public:
  using Guid = eprosima::fastrtps::rtps::GUID_t;

  /// `secured`: we have an identity, and peers are to authenticate themselves.
  explicit DiscoveryMonitor(bool secured) : secured_(secured) {}

  void add_local_endpoint(const Guid& guid, const std::string& topic, const std::string& type,
                          bool is_keyed, bool is_writer, const TopicQos& qos);
  void remove_local_endpoint(const Guid& guid);

  /// The others, in the order of their guids.
  [[nodiscard]] std::vector<RemoteParticipant> remote_participants() const;
  [[nodiscard]] std::vector<Endpoint> local_endpoints() const;

  /// The layout of announcements that ROS 2 nodes in the domain read; nothing where nobody does.
  [[nodiscard]] std::optional<RosGids> ros_gids() const;
  /// `changed` is called from within discovery when a node comes that reads announcements, and must
  /// only wake somebody. Empty: no more; when this returns, no call is under way.
  void watch_ros_peers(std::function<void()> changed);

 private:
  using Prefix = eprosima::fastrtps::rtps::GuidPrefix_t;

  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void onParticipantAuthentication(
      eprosima::fastdds::dds::DomainParticipant* participant,
      eprosima::fastrtps::rtps::ParticipantAuthenticationInfo&& info) override;
  void on_subscriber_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;
  void on_publisher_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
  using Clock = std::chrono::steady_clock;
  struct Known {
    RemoteParticipant peer;
    Clock::time_point since;
    bool authenticated = false;
  };
  [[nodiscard]] bool is_unauthenticated(const Known& known, Clock::time_point now) const;
  void add_remote_endpoint(const Guid& guid, Endpoint endpoint);
  void remove_remote_endpoint(const Guid& guid);

  bool secured_;
  mutable std::mutex mutex_;
  std::map<Prefix, Known> participants_;
  std::map<Guid, Endpoint> remote_endpoints_;
  std::map<Guid, Endpoint> local_endpoints_;
  std::function<void()> ros_peers_changed_;
};

}  // namespace stillmap::dds
