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
  const LoadedMap loaded = client.load_map(arguments.file);
  if (arguments.json) {
    std::cout << nlohmann::json{{"file", loaded.file},
                                {"map_id", loaded.map_id},
                                {"tiles", loaded.tile_count},
                                {"poses", loaded.pose_count}}
                     .dump(2)
              << "\n";
  } else {
    std::cout << "going on in " << loaded.file << " (on the server's machine): map "
              << loaded.map_id << ", " << loaded.tile_count << " tiles, " << loaded.pose_count
              << " poses\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_load_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command =
      program.command("load", "Have the server save its map and go on with another one");
  command
      .option("FILE", arguments->file,
              "Plain name of a map file beside the server's configured one")
      .required();
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap save before_rain.stillmap && stillmap load before_rain.stillmap\n"
      "  stillmap load depot.stillmap --json | jq .map_id\n"
      "The running map is saved to its own file first. From then on the server maps in FILE and\n"
      "saves to it, under a new map id; the next scan is expected where FILE's path ends, so the\n"
      "robot must stand there. A file that is missing, damaged, written by a newer version or of\n"
      "another voxel size is refused, and the running map goes on. A server that starts again\n"
      "begins with its configured file.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
