#include <algorithm>

#include "clients/doctor/checks.hpp"
#include "idl/interface/participant_diagnostics.hpp"
#include "idl/interface/services.hpp"

namespace stillmap::cli {
namespace {

bool is_server(const dds::RemoteParticipant& participant) {
  return std::ranges::any_of(participant.endpoints, [](const dds::Endpoint& endpoint) {
    return !endpoint.is_writer && endpoint.topic.ends_with("/get_statusRequest");
  });
}

bool sends_clouds(const dds::RemoteParticipant& participant) {
  return std::ranges::any_of(participant.endpoints, [](const dds::Endpoint& endpoint) {
    return endpoint.is_writer && endpoint.type == cloud_type;
  });
}

// Other domains that contain a server or a sensor.
std::string describe_candidate_domains(const std::vector<OtherDomain>& domains) {
  std::string text;
  for (const OtherDomain& domain : domains) {
    for (const dds::RemoteParticipant& participant : domain.participants) {
      const bool server = is_server(participant);
      if (!server && !sends_clouds(participant)) continue;
      text.append(text.empty() ? "" : "; ")
          .append("domain " + std::to_string(domain.id))
          .append(server ? " has the server " : " has clouds of ")
          .append(describe(participant));
    }
  }
  return text;
}

std::string describe_domains_in_use(const std::vector<OtherDomain>& domains) {
  std::string text;
  for (const OtherDomain& domain : domains) {
    text.append(text.empty() ? "" : ", ").append(std::to_string(domain.id));
  }
  return text.empty() ? "no other domain shows anybody either"
                      : "there are participants in domain " + text;
}

dds::Diagnostic empty_domain_diagnostic(const SystemSnapshot& snapshot) {
  const std::string better = describe_candidate_domains(snapshot.other_domains);
  dds::Diagnostic diagnostic{
      .severity = dds::Severity::problem,
      .what = "nobody else is in domain " + std::to_string(snapshot.dds.domain_id),
      .evidence = better.empty() ? describe_domains_in_use(snapshot.other_domains) : better,
      .hint = {}};
  if (!better.empty()) {
    diagnostic.hint = "use that domain: --domain, ROS_DOMAIN_ID, dds.domain_id";
  } else if (snapshot.other_domains.empty()) {
    diagnostic.hint =
        "start stillmap-server; if it runs, check that both machines share a network "
        "that carries multicast, and the interfaces that both use";
  } else {
    diagnostic.hint = "compare --domain, ROS_DOMAIN_ID and dds.domain_id of all processes";
  }
  return diagnostic;
}

dds::Diagnostic missing_server_diagnostic(const SystemSnapshot& snapshot) {
  std::string names;
  for (const DiscoveredServer& server : snapshot.servers) {
    names.append(names.empty() ? "" : ", ").append(server.name_space);
  }
  const std::string better = describe_candidate_domains(snapshot.other_domains);
  dds::Diagnostic diagnostic{.severity = dds::Severity::problem,
                             .what = "no server '" + snapshot.server_name + "' in domain " +
                                     std::to_string(snapshot.dds.domain_id),
                             .evidence = {},
                             .hint = {}};
  if (!names.empty()) {
    diagnostic.evidence = "there is '" + names + "'";
    diagnostic.hint = "did you mean --server " + names + "?";
  } else if (!better.empty()) {
    diagnostic.evidence = better;
    diagnostic.hint = "use that domain: --domain, ROS_DOMAIN_ID, dds.domain_id";
  } else {
    diagnostic.evidence =
        "nobody here answers " + dds::services::get_status.in(snapshot.server_name);
    diagnostic.hint = "start stillmap-server --domain " + std::to_string(snapshot.dds.domain_id);
  }
  return diagnostic;
}

// Duplicates of the server, its missing status, another version.
Diagnostics server_diagnostics(const DiscoveredServer& server) {
  Diagnostics diagnostics;
  if (server.participants.size() > 1) {
    std::string list;
    for (const dds::RemoteParticipant& participant : server.participants) {
      list.append(list.empty() ? "" : "; ").append(describe(participant));
    }
    diagnostics.push_back(
        {.severity = dds::Severity::problem,
         .what = std::to_string(server.participants.size()) + " servers are called '" +
                 server.name_space + "'",
         .evidence =
             list +
             ": both map the same scans, either may answer, and neither saves, loads or resets",
         .hint = "stop one, or give it another topics.namespace or domain"});
  }
  if (!server.status) {
    diagnostics.push_back({.severity = dds::Severity::problem,
                           .what = "server '" + server.name_space + "' gives no status",
                           .evidence = server.fault,
                           .hint = "give client and server the same version of Stillmap; a server "
                                   "that hangs or is stopped has to be started again"});
  } else if (server.status->software_version != STILLMAP_VERSION) {
    diagnostics.push_back(
        {.severity = dds::Severity::advice,
         .what = "server and client have different versions",
         .evidence = "server " + server.status->software_version + ", client " + STILLMAP_VERSION,
         .hint = "install the same version on both machines"});
  }
  return diagnostics;
}

}  // namespace

Diagnostics check_domain(const SystemSnapshot& snapshot) {
  if (!snapshot.participants.empty()) return {};
  return {empty_domain_diagnostic(snapshot)};
}

Diagnostics check_security(const SystemSnapshot& snapshot) {
  return dds::security_diagnostics(snapshot.self, snapshot.participants);
}

Diagnostics check_silent_participants(const SystemSnapshot& snapshot) {
  return dds::silent_participant_diagnostics(snapshot.self, snapshot.participants);
}

Diagnostics check_servers(const SystemSnapshot& snapshot) {
  Diagnostics diagnostics;
  bool is_there = false;
  for (const DiscoveredServer& server : snapshot.servers) {
    if (server.name_space != snapshot.server_name) continue;
    is_there = true;
    const Diagnostics more = server_diagnostics(server);
    diagnostics.insert(diagnostics.end(), more.begin(), more.end());
  }
  // An empty domain is reported by check_domain(); a participant that refuses us may be a server.
  const bool is_explained = snapshot.participants.empty() || !check_security(snapshot).empty();
  if (!is_there && !is_explained) diagnostics.push_back(missing_server_diagnostic(snapshot));
  return diagnostics;
}

Diagnostics check_endpoints(const SystemSnapshot& snapshot) {
  std::vector<dds::RemoteParticipant> everybody = snapshot.participants;
  everybody.push_back(snapshot.self);
  return dds::mismatch_diagnostics(dds::mismatches(everybody));
}

}  // namespace stillmap::cli
