#include <iostream>
#include <memory>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"

namespace stillmap::cli {
namespace {

struct SaveArguments {
  ClientArguments client;
  std::string file;
  bool json = false;
};

ExitCode run(const SaveArguments& arguments) {
  Client client = connect(arguments.client);
  const std::string file = client.save_map(arguments.file);
  if (arguments.json) {
    std::cout << Json{{"file", file}}.dump(2) << "\n";
  } else {
    std::cout << "saved to " << file << " (on the server's machine)\n";
  }
  return ExitCode::ok;
}

struct LoadArguments {
  ClientArguments client;
  std::string file;
  bool json = false;
};

ExitCode run(const LoadArguments& arguments) {
  Client client = connect(arguments.client);
  const LoadedMap loaded = client.load_map(arguments.file);
  if (arguments.json) {
    std::cout << Json{{"file", loaded.file},
                      {"map_id", loaded.map_id},
                      {"tiles", loaded.tile_count},
                      {"poses", loaded.pose_count}}
                     .dump(2)
              << "\n";
  } else {
    std::cout << "resumed " << loaded.file << " (on the server's machine): map " << loaded.map_id
              << ", " << loaded.tile_count << " tiles, " << loaded.pose_count << " poses\n";
  }
  return ExitCode::ok;
}

struct ResetArguments {
  ClientArguments client;
  bool json = false;
};

ExitCode run(const ResetArguments& arguments) {
  Client client = connect(arguments.client);
  const std::uint64_t map_id = client.reset();
  if (arguments.json) {
    std::cout << Json{{"map_id", map_id}}.dump(2) << "\n";
  } else {
    std::cout << "poses and map are forgotten; the new map has id " << map_id << "\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_save_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<SaveArguments>();
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

void add_load_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<LoadArguments>();
  CommandHandle command =
      program.command("load", "Have the server save its map and resume another one");
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
      "another voxel size is refused, and the running map stays. A server that starts again\n"
      "begins with its configured file.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_reset_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<ResetArguments>();
  CommandHandle command = program.command("reset", "Have the server forget its poses and its map");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain("Example:\n  stillmap reset\nMap files that were saved stay as they are.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
