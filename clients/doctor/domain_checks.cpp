#include <algorithm>

#include "clients/doctor/checks.hpp"
#include "idl/interface/participant_diagnostics.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap {
namespace {

constexpr const char* cloud_type = "sensor_msgs::msg::dds_::PointCloud2_";

bool is_server(const Peer& peer) {
  return std::ranges::any_of(peer.endpoints, [](const Endpoint& endpoint) {
    return !endpoint.is_writer && endpoint.topic.ends_with("/get_statusRequest");
  });
}

bool sends_clouds(const Peer& peer) {
  return std::ranges::any_of(peer.endpoints, [](const Endpoint& endpoint) {
    return endpoint.is_writer && endpoint.type == cloud_type;
  });
}

// Domains where a server or a sensor is, those first that matter more.
std::string promising(const std::vector<OtherDomain>& domains) {
  std::string text;
  for (const OtherDomain& domain : domains) {
    for (const Peer& peer : domain.peers) {
      const bool server = is_server(peer);
      if (!server && !sends_clouds(peer)) continue;
      text.append(text.empty() ? "" : "; ")
          .append("domain " + std::to_string(domain.id))
          .append(server ? " has the server " : " has clouds of ")
          .append(describe(peer));
    }
  }
  return text;
}

std::string inhabited(const std::vector<OtherDomain>& domains) {
  std::string text;
  for (const OtherDomain& domain : domains) {
    text.append(text.empty() ? "" : ", ").append(std::to_string(domain.id));
  }
  return text.empty() ? "no other domain shows anybody either"
                      : "there are peers in domain " + text;
}

Finding nothing_here(const Evidence& evidence) {
  const std::string better = promising(evidence.other_domains);
  Finding finding{.severity = Severity::problem,
                  .what = "nobody else is in domain " + std::to_string(evidence.dds.domain_id),
                  .evidence = better.empty() ? inhabited(evidence.other_domains) : better,
                  .way_out = {}};
  if (!better.empty()) {
    finding.way_out = "use that domain: --domain, ROS_DOMAIN_ID, dds.domain_id";
  } else if (evidence.other_domains.empty()) {
    finding.way_out =
        "start stillmap-server; if it runs, check that both machines share a network "
        "that carries multicast, and the interfaces that both use";
  } else {
    finding.way_out = "compare --domain, ROS_DOMAIN_ID and dds.domain_id of all processes";
  }
  return finding;
}

Finding server_elsewhere(const Evidence& evidence) {
  std::string names;
  for (const ServerSeen& server : evidence.servers) {
    names.append(names.empty() ? "" : ", ").append(server.name_space);
  }
  const std::string better = promising(evidence.other_domains);
  Finding finding{.severity = Severity::problem,
                  .what = "no server '" + evidence.server_name + "' in domain " +
                          std::to_string(evidence.dds.domain_id),
                  .evidence = {},
                  .way_out = {}};
  if (!names.empty()) {
    finding.evidence = "there is '" + names + "'";
    finding.way_out = "did you mean --server " + names + "?";
  } else if (!better.empty()) {
    finding.evidence = better;
    finding.way_out = "use that domain: --domain, ROS_DOMAIN_ID, dds.domain_id";
  } else {
    finding.evidence = "nobody here answers " + Services::in(evidence.server_name).get_status;
    finding.way_out = "start stillmap-server --domain " + std::to_string(evidence.dds.domain_id);
  }
  return finding;
}

// Ends that a client of that server would have, though we did not make them.
Findings judge(const ServerSeen& server) {
  Findings findings;
  if (server.peers.size() > 1) {
    std::string list;
    for (const Peer& peer : server.peers) {
      list.append(list.empty() ? "" : "; ").append(describe(peer));
    }
    findings.push_back({.severity = Severity::problem,
                        .what = std::to_string(server.peers.size()) + " servers are called '" +
                                server.name_space + "'",
                        .evidence = list + ": both map the same scans, and either may answer",
                        .way_out = "stop one, or give it another topics.namespace or domain"});
  }
  if (!server.status) {
    findings.push_back({.severity = Severity::problem,
                        .what = "server '" + server.name_space + "' gives no status",
                        .evidence = server.fault,
                        .way_out = "give client and server the same version of Stillmap; a server "
                                   "that hangs or is stopped has to be started again"});
  } else if (server.status->software_version != STILLMAP_VERSION) {
    findings.push_back(
        {.severity = Severity::advice,
         .what = "server and client have different versions",
         .evidence = "server " + server.status->software_version + ", client " + STILLMAP_VERSION,
         .way_out = "install the same version on both machines"});
  }
  return findings;
}

}  // namespace

Findings check_domain(const Evidence& evidence) {
  if (!evidence.peers.empty()) return {};
  return {nothing_here(evidence)};
}

Findings check_security(const Evidence& evidence) {
  return security_findings(evidence.self, evidence.peers);
}

Findings check_silent_peers(const Evidence& evidence) {
  return silent_peer_findings(evidence.self, evidence.peers);
}

Findings check_servers(const Evidence& evidence) {
  Findings findings;
  bool is_there = false;
  for (const ServerSeen& server : evidence.servers) {
    if (server.name_space != evidence.server_name) continue;
    is_there = true;
    const Findings more = judge(server);
    findings.insert(findings.end(), more.begin(), more.end());
  }
  // With nobody there, check_domain() says it; a server may be behind a peer that ignores us.
  const bool is_explained = evidence.peers.empty() || !check_security(evidence).empty();
  if (!is_there && !is_explained) findings.push_back(server_elsewhere(evidence));
  return findings;
}

Findings check_endpoints(const Evidence& evidence) {
  std::vector<Peer> everybody = evidence.peers;
  everybody.push_back(evidence.self);
  return mismatch_findings(mismatches(everybody));
}

}  // namespace stillmap
