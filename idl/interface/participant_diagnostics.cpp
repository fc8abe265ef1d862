#include "idl/interface/participant_diagnostics.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>

#include "idl/dds/ros_graph.hpp"
#include "idl/dds/service_topics.hpp"
#include "idl/interface/services.hpp"

namespace stillmap::dds {
namespace {

struct PolicyHint {
  std::string_view policy;
  const char* hint;
};

constexpr PolicyHint policy_hints[] = {
    {"type", "give both the same message type, or one of them another topic name"},
    {"keys",
     "ROS 2 nodes up to Jazzy have no keys and cannot read such topics: they use static_cloud, the "
     "traversability grid, and the service get_tiles; other programs: build both from the same "
     "definition of the message"},
    {"reliability",
     "let the writer be reliable, or the reader best effort (of stillmap-server's scans: "
     "input.delivery: latest)"},
    {"durability", "let the writer be transient local, or the reader volatile"},
    {"deadline", "let the reader's deadline be no shorter than the writer's"},
    {"liveliness", "let the writer's liveliness be as strong as the reader wants it"},
    {"ownership", "give both the same ownership"},
    {"partition", "put both into the same partition"}};

std::string hints_for(const std::vector<std::string>& incompatible_policies) {
  std::string text;
  for (const PolicyHint& policy_hint : policy_hints) {
    const bool helps = std::ranges::any_of(incompatible_policies, [&](const std::string& one) {
      return one.starts_with(policy_hint.policy);
    });
    if (helps) text.append(text.empty() ? "" : "; ").append(policy_hint.hint);
  }
  return text;
}

std::string joined(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) text.append(text.empty() ? "" : "; ").append(part);
  return text;
}

/// Who has the endpoint; nulls where it is gone.
std::pair<const RemoteParticipant*, const Endpoint*> owner_of(
    const std::string& endpoint_guid, const std::vector<RemoteParticipant>& peers) {
  for (const RemoteParticipant& peer : peers) {
    const auto found = std::ranges::find(peer.endpoints, endpoint_guid, &Endpoint::guid);
    if (found != peer.endpoints.end()) return {&peer, &*found};
  }
  return {nullptr, nullptr};
}

constexpr std::string_view namesake_words = "another server is called ";

bool is_on_loopback_only(const RemoteParticipant& participant) {
  return !participant.addresses.empty() &&
         std::ranges::all_of(participant.addresses, [](const std::string& address) {
           return address.starts_with("127.");
         });
}

/// By the names that Fast DDS gives servers 0 to 255, here and in ROS 2.
bool is_discovery_server(const RemoteParticipant& participant) {
  return participant.guid.starts_with("44.53.") &&
         participant.guid.ends_with(".5f.45.50.52.4f.53.49.4d.41");
}

constexpr const char* carriage_hint =
    "give the publisher's shared memory more room than a scan takes (Fast DDS: segment_size, 512 "
    "KB "
    "unless it is set), or switch it off on the server (dds.shared_memory: false)";
constexpr const char* network_hint =
    "sudo sysctl net.core.rmem_max=8388608 on this machine, or a network that carries the rate";

}  // namespace

Diagnostic several_publishers_diagnostic(const std::string& topic,
                                         const std::vector<std::string>& writer_guids,
                                         const std::vector<RemoteParticipant>& peers) {
  std::vector<std::string> publishers;
  for (const std::string& guid : writer_guids) {
    const RemoteParticipant* const peer = owner_of(guid, peers).first;
    publishers.push_back(peer == nullptr ? "a publisher that is gone, or unknown"
                                         : describe(*peer));
  }
  return {.severity = Severity::problem,
          .what = topic + ": " + std::to_string(writer_guids.size()) +
                  " publishers send scans in turns, and one lidar is expected",
          .evidence = joined(publishers) +
                      ": scans of each count as a next place of the same robot, or are dropped "
                      "where their stamps are of another time",
          .hint =
              "stop all but one (a replay beside the robot?), or give each robot a server and "
              "topics of its own; several lidars of one robot stand in 'sensors'"};
}

Diagnostic lost_scans_diagnostic(const std::string& topic, const ScanLosses& losses,
                                 const RemoteParticipant& self,
                                 const std::vector<RemoteParticipant>& peers) {
  const auto [peer, endpoint] = owner_of(losses.writer_guid, peers);
  const bool is_reliable = endpoint != nullptr && endpoint->qos.reliable;
  const bool by_shared_memory = peer != nullptr && peer->is_on_this_host &&
                                peer->uses_shared_memory && self.uses_shared_memory;
  const std::uint64_t sent = losses.received + losses.lost;
  Diagnostic diagnostic{
      .severity = 2 * losses.lost >= sent ? Severity::problem : Severity::advice,
      .what = topic + ": scans of " + (peer == nullptr ? "a publisher" : display_name(*peer)) +
              " get lost on the way",
      .evidence =
          std::to_string(losses.lost) + " of its last " + std::to_string(sent) + " did not arrive",
      .hint = by_shared_memory ? carriage_hint : network_hint};
  if (peer == nullptr) return diagnostic;
  diagnostic.evidence += "; " + describe(*peer) + " offers " + describe(endpoint->qos);
  if (is_reliable) {
    diagnostic.evidence +=
        ": it replaced them before they could be sent again, or this machine had no time to take "
        "them";
    diagnostic.hint =
        std::string("let the publisher keep more scans (keep last 5 or more); ") + diagnostic.hint;
  } else {
    diagnostic.evidence += ": what gets lost is not sent again";
    diagnostic.hint = std::string("let the publisher offer reliable delivery; ") + diagnostic.hint;
  }
  return diagnostic;
}

Diagnostic to_diagnostic(const Mismatch& mismatch) {
  // Without it, ROS 2 tools show no node names; data flows.
  const bool harmless = mismatch.topic == ros_discovery_topic;
  return {.severity = harmless ? Severity::advice : Severity::problem,
          .what = mismatch.topic + ": what " + display_name(*mismatch.writer_participant) +
                  " writes does not reach " + display_name(*mismatch.reader_participant),
          .evidence = joined(mismatch.incompatible_policies) +
                      "; writer: " + describe(*mismatch.writer_participant) +
                      ", reader: " + describe(*mismatch.reader_participant),
          .hint = hints_for(mismatch.incompatible_policies)};
}

std::vector<Diagnostic> mismatch_diagnostics(const Mismatches& mismatches) {
  std::vector<Diagnostic> diagnostics;
  for (const Mismatch& mismatch : mismatches.found) {
    Diagnostic diagnostic = to_diagnostic(mismatch);
    const bool is_known = std::ranges::any_of(diagnostics, [&](const Diagnostic& known) {
      return known.what == diagnostic.what && known.evidence == diagnostic.evidence;
    });
    if (!is_known) diagnostics.push_back(std::move(diagnostic));
  }
  if (mismatches.left_out > 0) {
    diagnostics.push_back(
        {.severity = Severity::problem,
         .what = "more writers and readers do not match: " + std::to_string(mismatches.left_out),
         .evidence = "only the first " + std::to_string(mismatches.found.size()) + " are listed",
         .hint = "mend those that are listed, or give programs that have nothing to do with each "
                 "other domains of their own"});
  }
  return diagnostics;
}

std::vector<Diagnostic> security_diagnostics(const RemoteParticipant& self,
                                             const std::vector<RemoteParticipant>& peers) {
  std::vector<Diagnostic> diagnostics;
  for (const RemoteParticipant& peer : peers) {
    if (peer.name == survey_participant) continue;
    if (peer.is_secured && !self.is_secured) {
      diagnostics.push_back(
          {.severity = Severity::problem,
           .what = display_name(peer) + " is secured and " + display_name(self) + " is not",
           .evidence = describe(peer) + " announces an identity of DDS Security and ignores "
                                        "everybody without one",
           .hint = "name an identity: --security FOLDER or STILLMAP_SECURITY; 'stillmap "
                   "security add' makes one"});
    } else if (!peer.is_secured && self.is_secured) {
      diagnostics.push_back(
          {.severity = Severity::problem,
           .what = display_name(peer) + " is not secured and is ignored",
           .evidence = describe(peer) + " is in this domain without an identity",
           .hint = "start it with --security FOLDER (ROS 2: an enclave), or in another domain"});
    } else if (peer.refused) {
      diagnostics.push_back(
          {.severity = Severity::problem,
           .what = display_name(peer) + " and " + display_name(self) + " refuse each other",
           .evidence = "authentication with " + describe(peer) +
                       " failed: another authority, an identity that expired, or a clock that is "
                       "wrong on one side",
           .hint = "run 'stillmap security check FOLDER' on both machines, and compare who "
                   "issued the two certificates and both clocks"});
    } else if (peer.unauthenticated) {
      diagnostics.push_back(
          {.severity = Severity::problem,
           .what = display_name(peer) + " and " + display_name(self) +
                   " have not authenticated each other",
           .evidence = "the handshake with " + describe(peer) +
                       " does not end, and this side is told no reason: the other one refuses our "
                       "identity (another authority, one that expired, a clock that is wrong), or "
                       "its messages get lost",
           .hint = "see what the other one says of it, and run 'stillmap security check FOLDER' on "
                   "both machines; where nothing is wrong, restart one of the two (Fast DDS before "
                   "2.6.5, 2.8.2 and 2.9.2 can leave a handshake in the middle)"});
    }
  }
  return diagnostics;
}

std::vector<Diagnostic> silent_participant_diagnostics(
    const RemoteParticipant& self, const std::vector<RemoteParticipant>& peers) {
  std::vector<Diagnostic> diagnostics;
  for (const RemoteParticipant& peer : peers) {
    const bool is_explained =
        peer.refused || peer.unauthenticated || peer.is_secured != self.is_secured;
    const bool has_none = peer.name == survey_participant || is_discovery_server(peer);
    if (!peer.endpoints.empty() || is_explained || has_none) continue;
    if (is_on_loopback_only(peer) && !is_on_loopback_only(self)) {
      diagnostics.push_back(
          {.severity = Severity::problem,
           .what = "nothing of " + display_name(peer) + " arrives: it keeps to this machine",
           .evidence = describe(peer) +
                       " is reached on the loopback interface only, as ROS 2 nodes "
                       "with ROS_LOCALHOST_ONLY=1 are",
           .hint = "localhost only: give Stillmap --dds-profile host (dds.profile: host), or the "
                   "same variable; or take it from the nodes"});
    } else if (peer.is_on_this_host && self.uses_shared_memory) {
      diagnostics.push_back(
          {.severity = Severity::problem,
           .what = "nothing of " + display_name(peer) + " arrives, though it runs on this host",
           .evidence = describe(peer) +
                       " is seen, but none of its topics: its shared memory (/dev/shm) is not "
                       "ours, as between containers or users",
           .hint = "switch shared memory off on both sides (--udp-only; dds.shared_memory: "
                   "false), or share it: the same user, and containers with --ipc host"});
    } else {
      diagnostics.push_back(
          {.severity = Severity::problem,
           .what = "nothing of " + display_name(peer) + " arrives",
           .evidence = describe(peer) + " is seen by multicast, but none of its topics",
           .hint = "let UDP ports 7400 to 65535 pass the firewalls between both machines"});
    }
  }
  return diagnostics;
}

std::vector<RemoteParticipant> servers_called(const std::string& name_space,
                                              const std::vector<RemoteParticipant>& peers) {
  const std::string answers = reply_topic(services::get_status.in(name_space));
  std::vector<RemoteParticipant> servers;
  std::ranges::copy_if(peers, std::back_inserter(servers), [&](const RemoteParticipant& peer) {
    return std::ranges::any_of(peer.endpoints, [&](const Endpoint& endpoint) {
      return endpoint.is_writer && endpoint.topic == answers;
    });
  });
  return servers;
}

std::vector<Diagnostic> namesake_diagnostics(const std::string& name_space,
                                             const std::vector<RemoteParticipant>& namesakes) {
  std::vector<Diagnostic> diagnostics;
  for (const RemoteParticipant& server : namesakes) {
    diagnostics.push_back(
        {.severity = Severity::problem,
         .what = std::string(namesake_words) + "'" + name_space + "' (" +
                 describe_location(server) + ")",
         .evidence =
             "both map the same scans, either may answer, and neither saves, loads or resets",
         .hint = "stop one, or give it another topics.namespace or domain"});
  }
  return diagnostics;
}

bool is_of_namesake(const Diagnostic& diagnostic) {
  return diagnostic.what.starts_with(namesake_words);
}

}  // namespace stillmap::dds
