#include "clients/commands/network/doctor_report.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

using nlohmann::json;

std::string counted(std::size_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

const char* name(dds::Severity severity) {
  return severity == dds::Severity::problem ? "problem" : "advice";
}

std::size_t count(const Diagnostics& diagnostics, dds::Severity severity) {
  return static_cast<std::size_t>(
      std::ranges::count(diagnostics, severity, &dds::Diagnostic::severity));
}

std::string participant_table(const SystemSnapshot& snapshot) {
  if (snapshot.participants.empty()) return {};
  Table table({"peer", "vendor", "where", "writers", "readers", "security"});
  for (const dds::RemoteParticipant& participant : snapshot.participants) {
    const auto writers = std::ranges::count(participant.endpoints, true, &dds::Endpoint::is_writer);
    const auto all = static_cast<std::ptrdiff_t>(participant.endpoints.size());
    table.add({participant.name, participant.vendor, dds::describe_location(participant),
               std::to_string(writers), std::to_string(all - writers),
               participant.refused ? "refused" : (participant.is_secured ? "yes" : "no")});
  }
  return table.text() + "\n";
}

std::string endpoint_table(const SystemSnapshot& snapshot) {
  Table table({"topic", "end", "peer", "quality of service", "type"});
  for (const dds::RemoteParticipant& participant : snapshot.participants) {
    for (const dds::Endpoint& endpoint : participant.endpoints) {
      table.add({endpoint.topic, endpoint.is_writer ? "writer" : "reader", participant.name,
                 describe(endpoint.qos), endpoint.type});
    }
  }
  return table.text() + "\n";
}

std::string other_domains(const SystemSnapshot& snapshot) {
  std::string text;
  for (const OtherDomain& domain : snapshot.other_domains) {
    text += (text.empty() ? "" : ", ") + std::to_string(domain.id);
    if (!domain.participants.empty())
      text += " (" + counted(domain.participants.size(), "peer") + ")";
  }
  return text.empty() ? "" : "other domains in use: " + text + "\n";
}

std::string text_of(const dds::Diagnostic& diagnostic) {
  const std::string label = diagnostic.severity == dds::Severity::problem ? "PROBLEM" : "ADVICE ";
  return label + "  " + diagnostic.what + "\n         seen: " + diagnostic.evidence +
         "\n         do:   " + diagnostic.hint + "\n\n";
}

json json_of(const dds::Endpoint& endpoint) {
  return {{"topic", endpoint.topic},
          {"type", endpoint.type},
          {"end", endpoint.is_writer ? "writer" : "reader"},
          {"qos", describe(endpoint.qos)}};
}

json json_of(const dds::RemoteParticipant& participant) {
  json endpoints = json::array();
  for (const dds::Endpoint& endpoint : participant.endpoints)
    endpoints.push_back(json_of(endpoint));
  return {{"name", participant.name},
          {"vendor", participant.vendor},
          {"host", participant.host},
          {"process", participant.process},
          {"user", participant.user},
          {"addresses", participant.addresses},
          {"this_host", participant.is_on_this_host},
          {"secured", participant.is_secured},
          {"refused", participant.refused},
          {"endpoints", endpoints}};
}

json json_of(const OtherDomain& domain) {
  json participants = json::array();
  for (const dds::RemoteParticipant& participant : domain.participants)
    participants.push_back(json_of(participant));
  return {{"id", domain.id}, {"senders", domain.senders}, {"peers", participants}};
}

}  // namespace

std::string doctor_text(const SystemSnapshot& snapshot, const Diagnostics& diagnostics,
                        bool endpoints) {
  std::string text = "domain " + std::to_string(snapshot.dds.domain_id) + ": " +
                     counted(snapshot.participants.size(), "peer") + "\n" +
                     other_domains(snapshot) + "\n";
  text += participant_table(snapshot);
  if (endpoints) text += endpoint_table(snapshot);
  for (const dds::Diagnostic& diagnostic : diagnostics) text += text_of(diagnostic);
  if (diagnostics.empty()) return text + "nothing is wrong\n";
  return text + counted(count(diagnostics, dds::Severity::problem), "problem") + ", " +
         counted(count(diagnostics, dds::Severity::advice), "piece") + " of advice\n";
}

json doctor_json(const SystemSnapshot& snapshot, const Diagnostics& diagnostics) {
  json participants = json::array(), domains = json::array(), list = json::array();
  for (const dds::RemoteParticipant& participant : snapshot.participants)
    participants.push_back(json_of(participant));
  for (const OtherDomain& domain : snapshot.other_domains) domains.push_back(json_of(domain));
  for (const dds::Diagnostic& diagnostic : diagnostics) {
    list.push_back({{"severity", name(diagnostic.severity)},
                    {"what", diagnostic.what},
                    {"evidence", diagnostic.evidence},
                    {"way_out", diagnostic.hint}});
  }
  return {{"domain", snapshot.dds.domain_id},
          {"problems", count(diagnostics, dds::Severity::problem)},
          {"findings", list},
          {"peers", participants},
          {"other_domains", domains},
          {"udp_buffer_bytes", snapshot.granted_buffer_bytes}};
}

}  // namespace stillmap::cli
