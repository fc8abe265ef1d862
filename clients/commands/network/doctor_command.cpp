#include <algorithm>
#include <iostream>
#include <memory>
#include <string>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/doctor/checks.hpp"
#include "clients/doctor/collect_snapshot.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/topic_name.hpp"

namespace stillmap::cli {
namespace {

std::string counted(std::size_t count, const std::string& thing) {
  return std::to_string(count) + " " + thing + (count == 1 ? "" : "s");
}

const char* severity_name(dds::Severity severity) {
  return severity == dds::Severity::problem ? "problem" : "advice";
}

std::size_t count(const Diagnostics& diagnostics, dds::Severity severity) {
  return static_cast<std::size_t>(
      std::ranges::count(diagnostics, severity, &dds::Diagnostic::severity));
}

const char* security_of(const dds::RemoteParticipant& participant) {
  if (participant.refused) return "refused";
  if (participant.unauthenticated) return "not authenticated";
  return participant.is_secured ? "yes" : "no";
}

std::string participant_table(const SystemSnapshot& snapshot) {
  if (snapshot.participants.empty()) return {};
  Table table({"participant", "vendor", "where", "writers", "readers", "security"});
  for (const dds::RemoteParticipant& participant : snapshot.participants) {
    const auto writers = std::ranges::count(participant.endpoints, true, &dds::Endpoint::is_writer);
    const auto all = static_cast<std::ptrdiff_t>(participant.endpoints.size());
    table.add({display_name(participant), participant.vendor, dds::describe_location(participant),
               std::to_string(writers), std::to_string(all - writers), security_of(participant)});
  }
  return table.text() + "\n";
}

std::string endpoint_table(const SystemSnapshot& snapshot) {
  Table table({"topic", "kind", "participant", "quality of service", "type"});
  for (const dds::RemoteParticipant& participant : snapshot.participants) {
    for (const dds::Endpoint& endpoint : participant.endpoints) {
      table.add({endpoint.topic, endpoint.is_writer ? "writer" : "reader",
                 display_name(participant), describe(endpoint.qos), endpoint.type});
    }
  }
  return table.text() + "\n";
}

std::string other_domains(const SystemSnapshot& snapshot) {
  std::string text;
  for (const OtherDomain& domain : snapshot.other_domains) {
    text += (text.empty() ? "" : ", ") + std::to_string(domain.id);
    if (!domain.participants.empty())
      text += " (" + counted(domain.participants.size(), "participant") + ")";
  }
  return text.empty() ? "" : "other domains in use: " + text + "\n";
}

std::string text_of(const dds::Diagnostic& diagnostic) {
  const std::string label = diagnostic.severity == dds::Severity::problem ? "PROBLEM" : "ADVICE ";
  return label + "  " + diagnostic.what + "\n         seen: " + diagnostic.evidence +
         "\n         do:   " + diagnostic.hint + "\n\n";
}

Json json_of(const dds::Endpoint& endpoint) {
  return {{"topic", endpoint.topic},
          {"type", endpoint.type},
          {"kind", endpoint.is_writer ? "writer" : "reader"},
          {"qos", describe(endpoint.qos)}};
}

Json json_of(const dds::RemoteParticipant& participant) {
  Json endpoints = Json::array();
  for (const dds::Endpoint& endpoint : participant.endpoints)
    endpoints.push_back(json_of(endpoint));
  return {{"name", participant.name},
          {"nodes", participant.ros_nodes},
          {"vendor", participant.vendor},
          {"host", participant.host},
          {"process", participant.process},
          {"user", participant.user},
          {"addresses", participant.addresses},
          {"this_host", participant.is_on_this_host},
          {"secured", participant.is_secured},
          {"refused", participant.refused},
          {"unauthenticated", participant.unauthenticated},
          {"endpoints", endpoints}};
}

Json json_of(const OtherDomain& domain) {
  Json participants = Json::array();
  for (const dds::RemoteParticipant& participant : domain.participants)
    participants.push_back(json_of(participant));
  return {{"id", domain.id}, {"senders", domain.senders}, {"participants", participants}};
}

/// Participants and diagnostics as text. `endpoints`: with every reader and writer.
std::string doctor_text(const SystemSnapshot& snapshot, const Diagnostics& diagnostics,
                        bool endpoints) {
  std::string text = "domain " + std::to_string(snapshot.dds.domain_id) + ": " +
                     counted(snapshot.participants.size(), "participant") + "\n" +
                     other_domains(snapshot) + "\n";
  text += participant_table(snapshot);
  if (endpoints) text += endpoint_table(snapshot);
  for (const dds::Diagnostic& diagnostic : diagnostics) text += text_of(diagnostic);
  if (diagnostics.empty()) return text + "nothing is wrong\n";
  return text + counted(count(diagnostics, dds::Severity::problem), "problem") + ", " +
         counted(count(diagnostics, dds::Severity::advice), "piece") + " of advice\n";
}

Json doctor_json(const SystemSnapshot& snapshot, const Diagnostics& diagnostics) {
  Json participants = Json::array(), domains = Json::array(), list = Json::array();
  for (const dds::RemoteParticipant& participant : snapshot.participants)
    participants.push_back(json_of(participant));
  for (const OtherDomain& domain : snapshot.other_domains) domains.push_back(json_of(domain));
  for (const dds::Diagnostic& diagnostic : diagnostics) {
    list.push_back({{"severity", severity_name(diagnostic.severity)},
                    {"what", diagnostic.what},
                    {"evidence", diagnostic.evidence},
                    {"hint", diagnostic.hint}});
  }
  return {{"domain", snapshot.dds.domain_id},
          {"problems", count(diagnostics, dds::Severity::problem)},
          {"diagnostics", list},
          {"participants", participants},
          {"other_domains", domains},
          {"udp_buffer_bytes", snapshot.granted_buffer_bytes}};
}

struct DoctorArguments {
  ClientArguments client;
  std::string points = "points";
  double listening_s = 4.0;
  std::string host_root = "/";
  bool endpoints = false;
  bool clean = false;
  bool json = false;
};

DoctorOptions options_of(const DoctorArguments& arguments) {
  // In the role of a sensor, which uses shared memory, so that this is checked, too.
  return {.dds = arguments.client.dds(DdsRole::sensor),
          .server_name = arguments.client.server_name,
          .points_topic = arguments.points,
          .timeout = arguments.client.timeout(),
          .listening =
              std::chrono::milliseconds(static_cast<std::int64_t>(1000.0 * arguments.listening_s)),
          .host_root = arguments.host_root};
}

ExitCode run(const DoctorArguments& arguments) {
  if (arguments.clean) {
    std::cerr << "removed "
              << dds::remove_stale_segments(std::filesystem::path(arguments.host_root) / "dev/shm",
                                            std::chrono::seconds(0))
              << " shared memory segments of dead processes\n";
  }
  const SystemSnapshot snapshot = collect_snapshot(options_of(arguments));
  const Diagnostics diagnostics = diagnose(snapshot);
  if (arguments.json) {
    std::cout << doctor_json(snapshot, diagnostics).dump(2) << "\n";
  } else {
    std::cout << doctor_text(snapshot, diagnostics, arguments.endpoints);
  }
  const bool has_problem = std::ranges::any_of(diagnostics, [](const dds::Diagnostic& diagnostic) {
    return diagnostic.severity == dds::Severity::problem;
  });
  return has_problem ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_doctor_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<DoctorArguments>();
  CommandHandle command = program.command(
      "doctor", "Find out why no data flows: network, quality of service, machine, server");
  add_client_options(command, arguments->client);
  command
      .option("--points", arguments->points,
              "The sensor's topic, where no server tells it by itself")
      .corrected(to_topic_name)
      .with_default();
  command.option("--listen", arguments->listening_s, "How long to listen to the network [s]")
      .above_zero_to(3600)
      .with_default();
  command
      .option("--host-root", arguments->host_root,
              "Where /proc, /sys and /dev/shm of the machine lie, as seen from a container")
      .with_default();
  command.flag("--endpoints", arguments->endpoints, "List every reader and writer");
  command.flag("--clean", arguments->clean,
               "Remove the shared memory that dead processes left behind");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Checks the domain's participants and their quality of service, the scans on their way to\n"
      "the server, this machine, and other domains.\n"
      "Examples:\n"
      "  stillmap doctor\n"
      "  stillmap doctor --domain 7 --endpoints\n"
      "  stillmap doctor --security keys/planner --json | jq .diagnostics\n"
      "Exit codes: 0 no problem (advice at most), 1 problems were found.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
