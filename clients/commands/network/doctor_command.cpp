#include <algorithm>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/network/doctor_report.hpp"
#include "clients/doctor/collect_snapshot.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  ClientArguments client;
  std::string points = "points";
  double listening_s = 4.0;
  std::string host_root = "/";
  bool endpoints = false;
  bool clean = false;
  bool json = false;
};

DoctorOptions options_of(const Arguments& arguments) {
  // As a sensor: shared memory is looked at, too.
  return {.dds = arguments.client.dds(DdsRole::sensor),
          .server_name = arguments.client.server_name,
          .points_topic = arguments.points,
          .timeout = arguments.client.timeout(),
          .listening =
              std::chrono::milliseconds(static_cast<std::int64_t>(1000.0 * arguments.listening_s)),
          .host_root = arguments.host_root};
}

ExitCode run(const Arguments& arguments) {
  if (arguments.clean) {
    std::cerr << "removed " << remove_stale_segments(arguments.host_root)
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
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = program.command("doctor", "Why is nothing happening?");
  add_client_options(command, arguments->client);
  command
      .option("--points", arguments->points,
              "The sensor's topic, where no server tells it by itself")
      .with_default();
  command.option("--listen", arguments->listening_s, "How long to listen to the network [s]")
      .above_zero()
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
      "Looks at the domain's peers and their quality of service, at the scans' way, at this\n"
      "machine, and at other domains.\n"
      "Examples:\n"
      "  stillmap doctor\n"
      "  stillmap doctor --domain 7 --endpoints\n"
      "  stillmap doctor --security keys/planner --json | jq .findings\n"
      "Exit codes: 0 no problem (advice at most), 1 problems were found.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
