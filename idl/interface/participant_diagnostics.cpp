#include "idl/interface/participant_diagnostics.hpp"

#include <algorithm>
#include <string_view>

namespace stillmap {
namespace {

// Only names of nodes get lost by it.
constexpr std::string_view ros_discovery = "ros_discovery_info";

struct Remedy {
  std::string_view policy;
  const char* way_out;
};

constexpr Remedy remedies[] = {
    {"type", "give both the same message type, or one of them another topic name"},
    {"keys", "build both from the same definition of the message"},
    {"reliability",
     "let the writer be reliable, or the reader best effort (of stillmap-server's scans: "
     "input.delivery: latest)"},
    {"durability", "let the writer be transient local, or the reader volatile"},
    {"deadline", "let the reader's deadline be no shorter than the writer's"},
    {"liveliness", "let the writer's liveliness be as strong as the reader wants it"},
    {"ownership", "give both the same ownership"},
    {"partition", "put both into the same partition"}};

std::string way_out_of(const std::vector<std::string>& obstacles) {
  std::string text;
  for (const Remedy& remedy : remedies) {
    const bool helps = std::ranges::any_of(
        obstacles, [&](const std::string& one) { return one.starts_with(remedy.policy); });
    if (helps) text.append(text.empty() ? "" : "; ").append(remedy.way_out);
  }
  return text;
}

std::string joined(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) text.append(text.empty() ? "" : "; ").append(part);
  return text;
}

std::string short_name(const Peer& peer) {
  return peer.name.empty() ? "a participant without a name" : peer.name;
}

}  // namespace

Finding finding_of(const Mismatch& mismatch) {
  const bool harmless = mismatch.topic == ros_discovery;
  return {.severity = harmless ? Severity::advice : Severity::problem,
          .what = mismatch.topic + ": what " + short_name(mismatch.writer_peer) +
                  " writes does not reach " + short_name(mismatch.reader_peer),
          .evidence = joined(mismatch.obstacles) + "; writer: " + describe(mismatch.writer_peer) +
                      ", reader: " + describe(mismatch.reader_peer),
          .way_out = way_out_of(mismatch.obstacles)};
}

std::vector<Finding> mismatch_findings(const std::vector<Mismatch>& mismatches) {
  std::vector<Finding> findings;
  for (const Mismatch& mismatch : mismatches) {
    Finding finding = finding_of(mismatch);
    const bool is_known = std::ranges::any_of(findings, [&](const Finding& known) {
      return known.what == finding.what && known.evidence == finding.evidence;
    });
    if (!is_known) findings.push_back(std::move(finding));
  }
  return findings;
}

std::vector<Finding> security_findings(const Peer& self, const std::vector<Peer>& peers) {
  std::vector<Finding> findings;
  for (const Peer& peer : peers) {
    if (peer.is_secured && !self.is_secured) {
      findings.push_back(
          {.severity = Severity::problem,
           .what = short_name(peer) + " is secured and " + short_name(self) + " is not",
           .evidence = describe(peer) + " announces an identity of DDS Security and ignores "
                                        "everybody without one",
           .way_out = "name an identity: --security FOLDER or STILLMAP_SECURITY; 'stillmap "
                      "security add' makes one"});
    } else if (!peer.is_secured && self.is_secured) {
      findings.push_back(
          {.severity = Severity::problem,
           .what = short_name(peer) + " is not secured and is ignored",
           .evidence = describe(peer) + " is in this domain without an identity",
           .way_out = "start it with --security FOLDER (ROS 2: an enclave), or in another domain"});
    } else if (peer.refused) {
      findings.push_back(
          {.severity = Severity::problem,
           .what = short_name(peer) + " and " + short_name(self) + " refuse each other",
           .evidence = "authentication with " + describe(peer) +
                       " failed: another authority, an identity that expired, or a clock that is "
                       "wrong on one side",
           .way_out = "run 'stillmap security check FOLDER' on both machines, and compare who "
                      "issued the two certificates and both clocks"});
    }
  }
  return findings;
}

std::vector<Finding> silent_peer_findings(const Peer& self, const std::vector<Peer>& peers) {
  std::vector<Finding> findings;
  for (const Peer& peer : peers) {
    const bool is_explained = peer.refused || peer.is_secured != self.is_secured;
    if (!peer.endpoints.empty() || is_explained) continue;
    if (peer.is_on_this_host && self.uses_shared_memory) {
      findings.push_back(
          {.severity = Severity::problem,
           .what = "nothing of " + short_name(peer) + " arrives, though it runs on this host",
           .evidence = describe(peer) +
                       " is seen, but none of its topics: its shared memory (/dev/shm) is not "
                       "ours, as between containers or users",
           .way_out = "switch shared memory off on both sides (--udp-only; dds.shared_memory: "
                      "false), or share it: the same user, and containers with --ipc host"});
    } else {
      findings.push_back(
          {.severity = Severity::problem,
           .what = "nothing of " + short_name(peer) + " arrives",
           .evidence = describe(peer) + " is seen by multicast, but none of its topics",
           .way_out = "let UDP ports 7400 to 65535 pass the firewalls between both machines"});
    }
  }
  return findings;
}

}  // namespace stillmap
