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
  bool overwrite = false;
  bool json = false;
};

ExitCode run(const SaveArguments& arguments) {
  Client client = connect(arguments.client);
  const std::string file = client.save_map(arguments.file, arguments.overwrite);
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
  bool discard = false;
  bool json = false;
};

ExitCode run(const ResetArguments& arguments) {
  Client client = connect(arguments.client);
  const BegunMap begun = client.reset(arguments.discard);
  if (arguments.json) {
    std::cout << Json{{"map_id", begun.map_id}, {"kept_file", begun.kept_file}}.dump(2) << "\n";
  } else {
    std::cout << "a new, empty map begins, with id " << begun.map_id << "; the one until now is "
              << (begun.kept_file.empty()
                      ? std::string("not kept")
                      : "kept as " + begun.kept_file + " (on the server's machine)")
              << "\n";
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
  command.flag("--overwrite", arguments->overwrite, "Replace a map that has this name already");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain("Examples:\n  stillmap save\n  stillmap save before_rain.stillmap");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_load_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<LoadArguments>();
  CommandHandle command =
      program.command("load", "Have the server save its map and resume another one");
  command.option("FILE", arguments->file,
                 "Plain name of a map file beside the server's configured one; without it, back to "
                 "the last save of the running map");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap save before_rain.stillmap && stillmap load before_rain.stillmap\n"
      "  stillmap load depot.stillmap --json | jq .map_id\n"
      "  stillmap load                               back to the last save\n"
      "The running map is saved to its own file first; only without FILE, or where it is that "
      "file, the map goes back to what was saved there last, and what was mapped since is gone; "
      "where somebody put another map in the file's place, it is that map. From then on the server "
      "maps in FILE and saves to it, under a new map id; the next scan is expected where FILE's "
      "path ends, so the robot must stand there. A file that is missing, damaged, written by a "
      "newer version or of another voxel size is refused, and the running map stays. A server that "
      "starts again begins with its configured file.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_reset_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<ResetArguments>();
  CommandHandle command = program.command(
      "reset", "Have the server begin a new, empty map, and keep the one until now");
  command.flag("--discard", arguments->discard, "Do not keep it");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap reset\n"
      "  stillmap reset --json | jq -r .kept_file\n"
      "The map until now is saved, and its file renamed: city.stillmap is kept beside it as "
      "city.2026-05-31_142500.stillmap, to return to with 'stillmap load'. A server without a map "
      "file keeps nothing: it refuses unless its map was saved by name, or with --discard.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
