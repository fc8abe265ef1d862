#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "clients/doctor/host_facts.hpp"
#include "idl/dds/dds_options.hpp"
#include "idl/dds/remote_participant.hpp"
#include "idl/interface/server_status.hpp"

namespace stillmap::cli {

/// A server that the domain shows, and what it answered.
struct DiscoveredServer {
  /// First part of its topic names.
  std::string name_space;
  /// Participants that answer under this name.
  std::vector<dds::RemoteParticipant> participants;
  std::optional<dds::ServerStatus> status;
  /// Why there is no status.
  std::string fault;
  /// This machine's clock in the middle of the question, nanoseconds since the Unix epoch.
  std::int64_t asked_ns = 0;
  /// How long question and answer took.
  std::int64_t round_trip_ns = 0;
};

/// Who is in another domain.
struct OtherDomain {
  std::uint32_t id = 0;
  std::set<std::string> senders;
  std::vector<dds::RemoteParticipant> participants;
};

/// Everything that the checks look at.
struct SystemSnapshot {
  dds::DdsOptions dds;
  /// First part of the topic names of the server that is asked for.
  std::string server_name;
  /// ROS 2 name of the sensor's topic.
  std::string points_topic;
  /// This process, with the endpoints of a client.
  dds::RemoteParticipant self;
  std::vector<dds::RemoteParticipant> participants;
  std::vector<DiscoveredServer> servers;
  std::vector<OtherDomain> other_domains;
  /// Frames that tf and tf_static named in the meantime.
  std::set<std::string> frames;
  HostFacts host;
  /// Bytes that the kernel gives to a UDP socket.
  std::uint32_t granted_buffer_bytes = 0;
};

}  // namespace stillmap::cli
