#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  ClientArguments client;
  std::string file;
  bool json = false;
};

ExitCode run(const Arguments& arguments) {
  Client client = connect(arguments.client);
  const std::string file = client.save_map(arguments.file);
  if (arguments.json) {
    std::cout << nlohmann::json{{"file", file}}.dump(2) << "\n";
  } else {
    std::cout << "saved to " << file << " (on the server's machine)\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_save_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = program.command("save", "Have the server save its map now");
  command.option(
      "FILE", arguments->file,
      "Plain name; the file is put beside the server's configured map file, which is the "
      "default");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain("Examples:\n  stillmap save\n  stillmap save before_rain.stillmap");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
