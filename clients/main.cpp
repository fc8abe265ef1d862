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

void add_commands(stillmap::cli::CommandHandle program, stillmap::cli::Action& action) {
  program.require_command();
  program.explain(introduction);
  stillmap::cli::add_map_command(program, action);
  stillmap::cli::add_traversable_command(program, action);
  stillmap::cli::add_plan_command(program, action);
  stillmap::cli::add_check_path_command(program, action);
  stillmap::cli::add_nearest_command(program, action);
  stillmap::cli::add_removed_command(program, action);
  stillmap::cli::add_replay_command(program, action);
  stillmap::cli::add_record_command(program, action);
  stillmap::cli::add_watch_command(program, action);
  stillmap::cli::add_watch_tiles_command(program, action);
  stillmap::cli::add_query_command(program, action);
  stillmap::cli::add_octomap_command(program, action);
  stillmap::cli::add_status_command(program, action);
  stillmap::cli::add_health_command(program, action);
  stillmap::cli::add_discovery_server_command(program, action);
  stillmap::cli::add_security_command(program, action);
  stillmap::cli::add_doctor_command(program, action);
  stillmap::cli::add_save_command(program, action);
  stillmap::cli::add_load_command(program, action);
  stillmap::cli::add_reset_command(program, action);
  stillmap::cli::add_map_info_command(program, action);
  stillmap::cli::add_map_check_command(program, action);
  stillmap::cli::add_map_diff_command(program, action);
  stillmap::cli::add_map_export_command(program, action);
  stillmap::cli::add_evaluate_command(program, action);
  stillmap::cli::add_simulate_command(program, action);
  stillmap::cli::add_simulate_training_command(program, action);
  stillmap::cli::add_dataset_command(program, action);
  stillmap::cli::add_model_command(program, action);
}

}  // namespace

int main(int argc, char** argv) {
  stillmap::dds::log_dds_to_stderr();
  stillmap::cli::CommandLine command_line("stillmap", STILLMAP_VERSION,
                                          "Lidar scans in, poses and a static semantic map out.");
  stillmap::cli::Action action;
  add_commands(command_line.root(), action);
  using enum stillmap::cli::CommandLine::Parsed;
  switch (command_line.parse(argc, argv)) {
    case answered:
      return static_cast<int>(stillmap::cli::ExitCode::ok);
    case wrong_usage:
      return static_cast<int>(stillmap::cli::ExitCode::bad_input);
    case command:
      break;
  }
  return static_cast<int>(stillmap::cli::run_action(action));
}
