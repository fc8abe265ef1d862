#include "clients/doctor/collect_snapshot.hpp"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <thread>

#include "clients/doctor/domain_scan.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/conversions/status.hpp"
#include "idl/dds/participant.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/dds/transports.hpp"
#include "idl/interface/participant_diagnostics.hpp"
#include "idl/interface/services.hpp"
#include "idl/interface/topics.hpp"
#include "stillmap_msgs.h"
#include "tf2_msgs.h"

namespace stillmap::cli {
namespace {

using stillmap_msgs::srv::GetStatus_Request;
using stillmap_msgs::srv::GetStatus_Response;
using tf2_msgs::msg::TFMessage;
using StatusClient = dds::ServiceClient<GetStatus_Request, GetStatus_Response>;

constexpr std::size_t max_other_domains = 12;
constexpr std::chrono::milliseconds domain_discovery_time{2500};

std::int64_t now_ns() {
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// Participants that answer get_status, by the first part of the service name.
std::map<std::string, std::vector<dds::RemoteParticipant>> name_spaces(
    const std::vector<dds::RemoteParticipant>& participants) {
  const std::string any = dds::request_topic(dds::services::get_status.in("*"));
  const std::string begin = any.substr(0, any.find('*'));
  const std::string end = any.substr(begin.size() + 1);
  std::map<std::string, std::vector<dds::RemoteParticipant>> found;
  for (const dds::RemoteParticipant& participant : participants) {
    for (const dds::Endpoint& endpoint : participant.endpoints) {
      const std::string& topic = endpoint.topic;
      if (endpoint.is_writer || !topic.starts_with(begin) || !topic.ends_with(end)) continue;
      found[topic.substr(begin.size(), topic.size() - begin.size() - end.size())].push_back(
          participant);
    }
  }
  return found;
}

void take_answer(const GetStatus_Response& reply, DiscoveredServer& server) {
  const auto& status = reply.status();
  if (status.code() != static_cast<std::uint8_t>(wire::ReplyCode::ok)) {
    server.fault = status.reason();
    return;
  }
  server.status = wire::from_wire(reply.server());
  if (!server.status) server.fault = "its status is of another version than ours";
}

DiscoveredServer query_status(dds::Participant& participant, const std::string& name_space,
                              std::vector<dds::RemoteParticipant> participants,
                              std::chrono::milliseconds timeout) {
  DiscoveredServer server;
  server.name_space = name_space;
  server.participants = std::move(participants);
  StatusClient client(participant, dds::services::get_status.in(name_space));
  server.fault = client.refusal();
  if (!server.fault.empty()) return server;
  GetStatus_Request request;
  request.format_version(dds::wire_format_version);
  const std::int64_t began = now_ns();
  const auto reply = client.call(request, timeout);
  server.round_trip_ns = now_ns() - began;
  server.asked_ns = began + server.round_trip_ns / 2;
  if (reply) {
    take_answer(*reply, server);
  } else {
    server.fault = "no answer within " + std::to_string(timeout.count()) + " ms";
  }
  return server;
}

void add_frames(const TFMessage& message, std::set<std::string>& frames) {
  for (const auto& transform : message.transforms()) {
    frames.insert(transform.header().frame_id());
    frames.insert(transform.child_frame_id());
  }
}

// Reads all transforms received so far.
void listen_to_frames(dds::Reader<TFMessage>& reader, std::set<std::string>& frames) {
  TFMessage message;
  while (reader.take(message, {}, std::chrono::milliseconds(0))) add_frames(message, frames);
}

std::vector<OtherDomain> inspect_domains(const DoctorOptions& options,
                                         const DomainSenders& senders) {
  std::vector<OtherDomain> domains;
  std::vector<std::unique_ptr<dds::Participant>> participants;
  for (const auto& [id, addresses] : senders) {
    if (id == options.dds.domain_id) continue;
    domains.push_back({.id = id, .senders = addresses, .participants = {}});
    if (participants.size() == max_other_domains) continue;
    dds::DdsOptions dds = options.dds;
    dds.domain_id = id;
    dds.participant_name = dds::survey_participant;
    // Leaves no segments in /dev/shm.
    dds.shared_memory = false;
    participants.push_back(std::make_unique<dds::Participant>(dds));
  }
  if (!participants.empty()) std::this_thread::sleep_for(domain_discovery_time);
  for (std::size_t i = 0; i < participants.size(); ++i)
    domains[i].participants = participants[i]->remote_participants();
  return domains;
}

dds::DdsOptions named(dds::DdsOptions dds) {
  dds.node_name = "stillmap_doctor";
  return dds;
}

/// Participants of this domain and of others, and the frames of tf.
void listen(const DoctorOptions& options, dds::Participant& participant, SystemSnapshot& snapshot) {
  const dds::TopicQos passing{.reliable = false, .depth = 100};
  const dds::TopicQos kept{.transient_local = true, .depth = 100};
  dds::Reader<TFMessage> moving(participant, "rt/tf", passing);
  std::optional<dds::Reader<TFMessage>> fixed;
  // The permissions of Stillmap's own identities do not include tf_static.
  if (options.dds.security.empty()) fixed.emplace(participant, "rt/tf_static", kept);
  DomainSenders senders = scan_domains(options.listening);
  for (const std::uint32_t id : domains_with_ports(snapshot.host.udp_ports)) senders[id];
  snapshot.participants = participant.remote_participants();
  listen_to_frames(moving, snapshot.frames);
  if (fixed) listen_to_frames(*fixed, snapshot.frames);
  snapshot.other_domains = inspect_domains(options, senders);
}

}  // namespace

SystemSnapshot collect_snapshot(const DoctorOptions& options) {
  SystemSnapshot snapshot{
      .dds = options.dds,
      .server_name = options.server_name,
      .points_topic = options.points_topic,
      .self = {},
      .participants = {},
      .servers = {},
      .other_domains = {},
      .frames = {},
      .host = read_host_facts(options.host_root),
      .granted_buffer_bytes = dds::granted_socket_buffer_bytes(options.dds.socket_buffer_bytes)};
  // The machine was read before this participant adds its own ports and segments; what it has
  // removed needs no advice.
  dds::Participant participant(named(options.dds));
  std::erase_if(snapshot.host.segments, [&](const dds::SharedMemorySegment& segment) {
    return !std::filesystem::exists(options.host_root / "dev/shm" / segment.name);
  });
  // A discovery server tells of nobody who has nothing for us.
  const StatusClient asks_for_status(participant,
                                     dds::services::get_status.in(options.server_name));
  listen(options, participant, snapshot);
  for (auto& [name_space, participants] : name_spaces(snapshot.participants)) {
    snapshot.servers.push_back(
        query_status(participant, name_space, participants, options.timeout));
  }
  snapshot.self = participant.self();
  return snapshot;
}

}  // namespace stillmap::cli
