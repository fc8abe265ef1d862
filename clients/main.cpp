#include "clients/commands/command.hpp"
#include "idl/dds/dds_log.hpp"

namespace {

constexpr const char* introduction =
    "Start here:\n"
    "  stillmap simulate city --scans 100         a recording, when there is none\n"
    "  stillmap map city --out city_map           map it in this process\n"
    "  stillmap replay city                       or send it to a running stillmap-server\n"
    "  stillmap query --around-robot 50           and ask that server for its map\n"
    "'stillmap COMMAND --help' shows a command's options and examples.\n"
    "Exit codes: 0 well; 1 the run failed; 2 wrong usage or input; 3 no server or no answer;\n"
    "4 'plan' found no path.";

void add_commands(stillmap::CommandHandle program, stillmap::Action& action) {
  program.require_command();
  program.explain(introduction);
  stillmap::add_map_command(program, action);
  stillmap::add_traversable_command(program, action);
  stillmap::add_plan_command(program, action);
  stillmap::add_check_path_command(program, action);
  stillmap::add_nearest_command(program, action);
  stillmap::add_removed_command(program, action);
  stillmap::add_replay_command(program, action);
  stillmap::add_record_command(program, action);
  stillmap::add_watch_command(program, action);
  stillmap::add_watch_tiles_command(program, action);
  stillmap::add_query_command(program, action);
  stillmap::add_octomap_command(program, action);
  stillmap::add_status_command(program, action);
  stillmap::add_health_command(program, action);
  stillmap::add_discovery_server_command(program, action);
  stillmap::add_security_command(program, action);
  stillmap::add_doctor_command(program, action);
  stillmap::add_save_command(program, action);
  stillmap::add_load_command(program, action);
  stillmap::add_reset_command(program, action);
  stillmap::add_map_info_command(program, action);
  stillmap::add_map_check_command(program, action);
  stillmap::add_map_diff_command(program, action);
  stillmap::add_map_export_command(program, action);
  stillmap::add_evaluate_command(program, action);
  stillmap::add_simulate_command(program, action);
  stillmap::add_simulate_training_command(program, action);
  stillmap::add_dataset_command(program, action);
  stillmap::add_model_command(program, action);
}

}  // namespace

int main(int argc, char** argv) {
  stillmap::log_dds_to_stderr();
  stillmap::CommandLine command_line("stillmap", STILLMAP_VERSION,
                                     "Lidar scans in, poses and a static semantic map out.");
  stillmap::Action action;
  add_commands(command_line.root(), action);
  using enum stillmap::CommandLine::Parsed;
  switch (command_line.parse(argc, argv)) {
    case answered:
      return static_cast<int>(stillmap::ExitCode::ok);
    case wrong_usage:
      return static_cast<int>(stillmap::ExitCode::bad_input);
    case command:
      break;
  }
  return static_cast<int>(stillmap::run_action(action));
}
