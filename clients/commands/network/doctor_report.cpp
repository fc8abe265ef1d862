#include "clients/commands/network/doctor_report.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "clients/terminal/table.hpp"

namespace stillmap {
namespace {

using nlohmann::json;

std::string counted(std::size_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

const char* name(Severity severity) { return severity == Severity::problem ? "problem" : "advice"; }

std::size_t count(const Findings& findings, Severity severity) {
  return static_cast<std::size_t>(std::ranges::count(findings, severity, &Finding::severity));
}

std::string peer_table(const Evidence& evidence) {
  if (evidence.peers.empty()) return {};
  Table table({"peer", "vendor", "where", "writers", "readers", "security"});
  for (const Peer& peer : evidence.peers) {
    const auto writers = std::ranges::count(peer.endpoints, true, &Endpoint::is_writer);
    const auto all = static_cast<std::ptrdiff_t>(peer.endpoints.size());
    table.add({peer.name, peer.vendor, whereabouts(peer), std::to_string(writers),
               std::to_string(all - writers),
               peer.refused ? "refused" : (peer.is_secured ? "yes" : "no")});
  }
  return table.text() + "\n";
}

std::string endpoint_table(const Evidence& evidence) {
  Table table({"topic", "end", "peer", "quality of service", "type"});
  for (const Peer& peer : evidence.peers) {
    for (const Endpoint& endpoint : peer.endpoints) {
      table.add({endpoint.topic, endpoint.is_writer ? "writer" : "reader", peer.name,
                 describe(endpoint.qos), endpoint.type});
    }
  }
  return table.text() + "\n";
}

std::string other_domains(const Evidence& evidence) {
  std::string text;
  for (const OtherDomain& domain : evidence.other_domains) {
    text += (text.empty() ? "" : ", ") + std::to_string(domain.id);
    if (!domain.peers.empty()) text += " (" + counted(domain.peers.size(), "peer") + ")";
  }
  return text.empty() ? "" : "other domains in use: " + text + "\n";
}

std::string text_of(const Finding& finding) {
  const std::string label = finding.severity == Severity::problem ? "PROBLEM" : "ADVICE ";
  return label + "  " + finding.what + "\n         seen: " + finding.evidence +
         "\n         do:   " + finding.way_out + "\n\n";
}

json json_of(const Endpoint& endpoint) {
  return {{"topic", endpoint.topic},
          {"type", endpoint.type},
          {"end", endpoint.is_writer ? "writer" : "reader"},
          {"qos", describe(endpoint.qos)}};
}

json json_of(const Peer& peer) {
  json endpoints = json::array();
  for (const Endpoint& endpoint : peer.endpoints) endpoints.push_back(json_of(endpoint));
  return {{"name", peer.name},
          {"vendor", peer.vendor},
          {"host", peer.host},
          {"process", peer.process},
          {"user", peer.user},
          {"addresses", peer.addresses},
          {"this_host", peer.is_on_this_host},
          {"secured", peer.is_secured},
          {"refused", peer.refused},
          {"endpoints", endpoints}};
}

json json_of(const OtherDomain& domain) {
  json peers = json::array();
  for (const Peer& peer : domain.peers) peers.push_back(json_of(peer));
  return {{"id", domain.id}, {"senders", domain.senders}, {"peers", peers}};
}

}  // namespace

std::string doctor_text(const Evidence& evidence, const Findings& findings, bool endpoints) {
  std::string text = "domain " + std::to_string(evidence.dds.domain_id) + ": " +
                     counted(evidence.peers.size(), "peer") + "\n" + other_domains(evidence) + "\n";
  text += peer_table(evidence);
  if (endpoints) text += endpoint_table(evidence);
  for (const Finding& finding : findings) text += text_of(finding);
  if (findings.empty()) return text + "nothing is wrong\n";
  return text + counted(count(findings, Severity::problem), "problem") + ", " +
         counted(count(findings, Severity::advice), "piece") + " of advice\n";
}

json doctor_json(const Evidence& evidence, const Findings& findings) {
  json peers = json::array(), domains = json::array(), list = json::array();
  for (const Peer& peer : evidence.peers) peers.push_back(json_of(peer));
  for (const OtherDomain& domain : evidence.other_domains) domains.push_back(json_of(domain));
  for (const Finding& finding : findings) {
    list.push_back({{"severity", name(finding.severity)},
                    {"what", finding.what},
                    {"evidence", finding.evidence},
                    {"way_out", finding.way_out}});
  }
  return {{"domain", evidence.dds.domain_id},
          {"problems", count(findings, Severity::problem)},
          {"findings", list},
          {"peers", peers},
          {"other_domains", domains},
          {"udp_buffer_bytes", evidence.granted_buffer_bytes}};
}

}  // namespace stillmap
