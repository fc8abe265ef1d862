#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  ClientArguments client;
  bool json = false;
};

ExitCode run(const Arguments& arguments) {
  Client client = connect(arguments.client);
  const std::uint64_t map_id = client.reset();
  if (arguments.json) {
    std::cout << nlohmann::json{{"map_id", map_id}}.dump(2) << "\n";
  } else {
    std::cout << "poses and map are forgotten; the new map has id " << map_id << "\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_reset_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = program.command("reset", "Have the server forget its poses and its map");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain("Example:\n  stillmap reset\nMap files that were saved stay as they are.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
