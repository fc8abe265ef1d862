#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_lock.hpp"
#include "core/map/storage/map_sessions.hpp"

namespace stillmap::cli {
namespace {

struct SessionsArguments {
  std::string file;
  int withdraw = 0;
  std::string out;
  bool force = false;
  bool json = false;
};

Json sessions_json(const std::vector<MapSession>& sessions) {
  Json list = Json::array();
  for (const MapSession& session : sessions) {
    list.push_back({{"number", session.number},
                    {"source", session.source.empty() ? Json(nullptr) : Json(session.source)},
                    {"first_pose", session.first_pose},
                    {"poses", session.poses},
                    {"way_m", session.way_m},
                    {"first_stamp_ns", session.first_stamp_ns},
                    {"last_stamp_ns", session.last_stamp_ns},
                    {"clock_offset_ns", session.clock_offset_ns},
                    {"closures", session.closures},
                    {"steps_back", session.steps_back}});
  }
  return list;
}

std::string sessions_table(const std::vector<MapSession>& sessions) {
  if (sessions.empty()) return "the map has no path: nothing was mapped in it yet\n";
  Table table({"session", "source", "poses", "way [m]", "from [s]", "to [s]", "closures"});
  const auto seconds = [](std::int64_t stamp_ns) {
    return fixed(static_cast<double>(stamp_ns) / 1e9, 1);
  };
  for (const MapSession& session : sessions) {
    table.add({std::to_string(session.number), session.source.empty() ? "?" : session.source,
               std::to_string(session.poses), fixed(session.way_m, 1),
               seconds(session.first_stamp_ns), seconds(session.last_stamp_ns),
               session.closures == 0 ? "-" : std::to_string(session.closures)});
  }
  std::string text = table.text();
  for (const MapSession& session : sessions) {
    if (session.steps_back == 0) continue;
    text += "the clock of session " + std::to_string(session.number) +
            " was set back while it was mapped, " +
            (session.steps_back == 1 ? "once" : std::to_string(session.steps_back) + " times") +
            ": a pose has an earlier stamp than the one before it\n";
  }
  return text;
}

/// Throws std::invalid_argument where the session cannot be withdrawn into this file.
void check_withdrawal(const SessionsArguments& arguments, const std::vector<MapSession>& sessions) {
  std::error_code not_there;
  if (std::filesystem::equivalent(arguments.file, arguments.out, not_there)) {
    throw std::invalid_argument(arguments.out +
                                " is the map itself, which stays as it is: name another --out");
  }
  if (std::filesystem::exists(arguments.out) && !arguments.force) {
    throw std::invalid_argument(arguments.out +
                                " exists already: choose another --out, or --force to replace it");
  }
  if (sessions.empty() || sessions.back().number != arguments.withdraw) {
    throw std::invalid_argument(
        "session " + std::to_string(arguments.withdraw) + " of " + arguments.file +
        " cannot be withdrawn: only the newest one can, since later ones built on it; that is " +
        (sessions.empty() ? "none" : std::to_string(sessions.back().number)) +
        ". Withdraw the newer ones first");
  }
}

ExitCode run(const SessionsArguments& arguments) {
  if (arguments.withdraw != 0 && arguments.out.empty()) {
    throw std::invalid_argument(
        "--withdraw needs --out: the map without the session is written there, and " +
        arguments.file + " stays as it is");
  }
  end_cleanly_when_stopped();
  std::vector<MapSession> sessions = read_map_sessions(arguments.file);
  if (arguments.withdraw != 0) {
    const MapLock lock(arguments.out);
    remove_useless_fresh_files(arguments.out);
    check_withdrawal(arguments, sessions);
    withdraw_newest_session(arguments.file, arguments.out);
    sessions.pop_back();
  }
  std::cout << (arguments.json ? sessions_json(sessions).dump(2) + "\n" : sessions_table(sessions));
  if (arguments.withdraw != 0 && !arguments.json) {
    std::cout << "session " << arguments.withdraw << " is withdrawn in " << arguments.out << "; "
              << arguments.file << " is as it was\n";
  }
  return ExitCode::ok;
}

}  // namespace

void add_sessions_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<SessionsArguments>();
  CommandHandle command = program.command(
      "sessions", "List the drives that a map file is made of, and withdraw the newest");
  command.option("FILE,--map", arguments->file, "A map file; it is only read").required();
  const OptionHandle withdraw =
      command
          .option("--withdraw", arguments->withdraw,
                  "Number of the newest session: write the map as it was before it")
          .above_zero();
  command
      .option("--out,--output,-o", arguments->out, "Where the map without the session is written")
      .needs(withdraw);
  command.flag("--force", arguments->force, "Replace the file --out where it exists")
      .needs(withdraw);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap sessions both/map.stillmap\n"
      "  stillmap sessions both/map.stillmap --withdraw 2 --out monday_again.stillmap\n"
      "A session is a drive that 'stillmap map --onto' put onto a map, a map that\n"
      "'stillmap merge' did, or a run of a server that went on in the file. The file keeps the\n"
      "tiles that a session changed as they were: without it the map is again what it was, to the\n"
      "last voxel. Only the newest session can be withdrawn, then the one before it; of servers'\n"
      "runs, the newest two (map.withdrawable_sessions). To undo what a server mapped, stop it,\n"
      "withdraw the session, and start the server with the file that --out names.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
