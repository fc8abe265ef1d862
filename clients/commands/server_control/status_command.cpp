#include <iostream>
#include <memory>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/server_control/status_report.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

struct StatusArguments {
  ClientArguments client;
  bool json = false;
};

ExitCode run(const StatusArguments& arguments) {
  Client client = connect(arguments.client);
  const dds::ServerStatus status = client.status();
  std::cout << (arguments.json ? status_json(status).dump(2) + "\n" : status_text(status));
  return ExitCode::ok;
}

struct HealthArguments {
  ClientArguments client;
  bool mapping = false;
  bool json = false;
};

/// Why the server loses what it maps when it ends; empty when it does not.
std::string why_not_saved(const dds::ServerStatus& status) {
  const std::uint64_t failing = status.counter(dds::checkpoints_failing_counter);
  if (failing == 0) return {};
  return std::to_string(failing) + " checkpoints in a row failed: " + status.reason;
}

/// Why the server does not map; empty when it does.
std::string why_not_mapping(const dds::ServerStatus& status) {
  const std::string reason = status.reason.empty() ? "" : ": " + status.reason;
  if (status.received_hz == 0.0) return "no scans arrive" + reason;
  if (status.mapped_hz == 0.0) return "no scan is mapped" + reason;
  if (status.health == OdometryHealth::lost) return "the odometry is lost" + reason;
  return {};
}

/// What is wrong beside the reason, in one line: scans that get lost, peers that do not fit.
std::string other_diagnostics(const dds::ServerStatus& status) {
  std::string text;
  for (const dds::Diagnostic& diagnostic : status.diagnostics) {
    if (diagnostic.what != status.reason) text += "; " + diagnostic.what;
  }
  return text;
}

ExitCode run(const HealthArguments& arguments) {
  const auto say = [&](ExitCode code, const std::string& text) {
    const bool is_healthy = code == ExitCode::ok;
    if (arguments.json) {
      std::cout << Json{{"healthy", is_healthy}, {"text", text}}.dump(2) << "\n";
    } else {
      std::cout << (is_healthy ? "healthy: " : "unhealthy: ") << text << "\n";
    }
    return code;
  };
  dds::ServerStatus status;
  try {
    status = connect(arguments.client).status();
  } catch (const ServiceError& error) {
    return say(ExitCode::failed, error.what());
  }
  if (const std::string why = why_not_saved(status); !why.empty()) {
    return say(ExitCode::failed, why);
  }
  if (const std::string why = why_not_mapping(status); arguments.mapping && !why.empty()) {
    return say(ExitCode::failed, why + other_diagnostics(status));
  }
  return say(ExitCode::ok, "up for " + fixed(status.uptime_s, 0) + " s, " +
                               fixed(status.mapped_hz, 1) + " scans/s mapped" +
                               (status.reason.empty() ? "" : ", " + status.reason) +
                               other_diagnostics(status));
}

}  // namespace

void add_status_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<StatusArguments>();
  CommandHandle command =
      program.command("status", "What the server does: health, rates, counters, latencies, map");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap status\n"
      "  stillmap status --domain 7 --json | jq .health\n"
      "Exit code 3: no server answers in this domain.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_health_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<HealthArguments>();
  arguments->client.timeout_s = 4.0;
  CommandHandle command = program.command(
      "health", "Whether the server is well: exit code 0 or 1, and a line that says why");
  add_client_options(command, arguments->client);
  command.flag("--mapping", arguments->mapping,
               "Unhealthy as well when no scans arrive or none is mapped, or the odometry is lost");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap health                     is it alive: Docker's HEALTHCHECK, a liveness probe\n"
      "  stillmap health --mapping           does it work: a readiness probe on a driving robot\n"
      "A server that waits for its first scan is alive. One whose checkpoints fail is not well: "
      "what it maps is in memory alone.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
