#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/server_control/status_report.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  ClientArguments client;
  bool json = false;
};

ExitCode run(const Arguments& arguments) {
  Client client = connect(arguments.client);
  const dds::ServerStatus status = client.status();
  std::cout << (arguments.json ? to_json(status).dump(2) + "\n" : describe(status));
  return ExitCode::ok;
}

}  // namespace

void add_status_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
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

}  // namespace stillmap::cli
