#include "clients/doctor/collect_snapshot.hpp"

#include <algorithm>
#include <memory>
#include <thread>

#include "clients/doctor/domain_scan.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/conversions/status.hpp"
#include "idl/dds/participant.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/dds/transports.hpp"
#include "idl/interface/topics.hpp"
#include "stillmap_msgs.h"
#include "tf2_msgs.h"

namespace stillmap {
namespace {

using stillmap_msgs::srv::GetStatus_Request;
using stillmap_msgs::srv::GetStatus_Response;
using tf2_msgs::msg::TFMessage;
using StatusClient = ServiceClient<GetStatus_Request, GetStatus_Response>;

constexpr std::size_t most_other_domains = 12;
constexpr std::chrono::milliseconds look_into_domain{2500};

std::int64_t now_ns() {
  return std::chrono::nanoseconds(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// First parts of the names under which somebody answers get_status, and who that is.
std::map<std::string, std::vector<Peer>> name_spaces(const std::vector<Peer>& peers) {
  const std::string begin = "rq/";
  const std::string end = "/get_statusRequest";
  std::map<std::string, std::vector<Peer>> found;
  for (const Peer& peer : peers) {
    for (const Endpoint& endpoint : peer.endpoints) {
      const std::string& topic = endpoint.topic;
      if (endpoint.is_writer || !topic.starts_with(begin) || !topic.ends_with(end)) continue;
      found[topic.substr(begin.size(), topic.size() - begin.size() - end.size())].push_back(peer);
    }
  }
  return found;
}

void take_answer(const GetStatus_Response& reply, ServerSeen& server) {
  const auto& status = reply.status();
  if (status.code() != static_cast<std::uint8_t>(wire::ReplyCode::ok)) {
    server.fault = status.reason();
    return;
  }
  server.status = wire::from_wire(reply.server());
  if (!server.status) server.fault = "its status is of another version than ours";
}

ServerSeen ask(Participant& participant, const std::string& name_space, std::vector<Peer> peers,
               std::chrono::milliseconds timeout) {
  ServerSeen server;
  server.name_space = name_space;
  server.peers = std::move(peers);
  StatusClient client(participant, Services::in(name_space).get_status);
  server.fault = client.refusal();
  if (!server.fault.empty()) return server;
  GetStatus_Request request;
  request.format_version(wire_format_version);
  const std::int64_t began = now_ns();
  const auto reply = client.ask(request, timeout);
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

// Frames that are published now, and those that were published once for all.
void listen_to_frames(Reader<TFMessage>& reader, std::set<std::string>& frames) {
  TFMessage message;
  while (reader.take(message, {}, std::chrono::milliseconds(0))) add_frames(message, frames);
}

std::vector<OtherDomain> look_into(const DoctorOptions& options, const DomainSenders& senders) {
  std::vector<OtherDomain> domains;
  std::vector<std::unique_ptr<Participant>> visitors;
  for (const auto& [id, addresses] : senders) {
    if (id == options.dds.domain_id) continue;
    domains.push_back({.id = id, .senders = addresses, .peers = {}});
    if (visitors.size() == most_other_domains) continue;
    DdsOptions dds = options.dds;
    dds.domain_id = id;
    // A visitor leaves nothing behind.
    dds.shared_memory = false;
    visitors.push_back(std::make_unique<Participant>(dds));
  }
  if (!visitors.empty()) std::this_thread::sleep_for(look_into_domain);
  for (std::size_t i = 0; i < visitors.size(); ++i) domains[i].peers = visitors[i]->peers();
  return domains;
}

DdsOptions named(DdsOptions dds) {
  dds.node_name = "stillmap_doctor";
  return dds;
}

/// Who is there besides the participants that these hands make.
void listen(const DoctorOptions& options, Participant& participant, Evidence& evidence) {
  const TopicQos passing{.reliable = false, .depth = 100};
  const TopicQos kept{.transient_local = true, .depth = 100};
  Reader<TFMessage> moving(participant, "rt/tf", passing);
  std::optional<Reader<TFMessage>> fixed;
  // Identities made for Stillmap alone know nothing of tf_static.
  if (options.dds.security.empty()) fixed.emplace(participant, "rt/tf_static", kept);
  DomainSenders senders = listen_to_domains(options.listening);
  for (const std::uint32_t id : domains_with_ports(evidence.host.udp_ports)) senders[id];
  evidence.peers = participant.peers();
  listen_to_frames(moving, evidence.frames);
  if (fixed) listen_to_frames(*fixed, evidence.frames);
  evidence.other_domains = look_into(options, senders);
}

}  // namespace

Evidence gather(const DoctorOptions& options) {
  Evidence evidence{
      .dds = options.dds,
      .server_name = options.server_name,
      .points_topic = options.points_topic,
      .self = {},
      .peers = {},
      .servers = {},
      .other_domains = {},
      .frames = {},
      .host = read_host_facts(options.host_root),
      .granted_buffer_bytes = granted_socket_buffer_bytes(options.dds.socket_buffer_bytes)};
  // First the machine, then what changes it: ports and segments of ours.
  Participant participant(named(options.dds));
  listen(options, participant, evidence);
  for (auto& [name_space, peers] : name_spaces(evidence.peers)) {
    evidence.servers.push_back(ask(participant, name_space, peers, options.timeout));
  }
  evidence.self = participant.self();
  return evidence;
}

}  // namespace stillmap
