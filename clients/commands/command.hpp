#pragma once

#include <functional>

#include "clients/terminal/command_line.hpp"

namespace stillmap::cli {

/// Exit codes of the program.
enum class ExitCode {
  ok = 0,
  /// The run failed.
  failed = 1,
  /// Wrong usage, or input that cannot be used.
  bad_input = 2,
  /// No server, or no answer in time.
  no_server = 3,
  /// There is no path to plan.
  no_path = 4,
  /// A drive or a map was not recognised in another map.
  not_recognized = 5,
};

/// Help texts: the kinds of data set, and how the topic of a bag is chosen.
inline constexpr const char* dataset_kinds =
    "A KITTI sequence, a folder of .bin, .pcd or .ply files, one such file, or a ROS 2 bag "
    "(folder, "
    ".db3 or .mcap)";
inline constexpr const char* topic_in_help =
    "The bag's topic to read; needed when it has several with scans";

/// The chosen command with its options, ready to run. Set while the command line is parsed.
using Action = std::function<ExitCode()>;

/// Adds every command of `stillmap`.
void add_commands(CommandHandle program, Action& action);

// Each adds one subcommand to the program; when it is chosen, it sets `action`.
void add_map_command(CommandHandle program, Action& action);
void add_loops_command(CommandHandle program, Action& action);
void add_localize_command(CommandHandle program, Action& action);
void add_traversable_command(CommandHandle program, Action& action);
void add_plan_command(CommandHandle program, Action& action);
void add_check_path_command(CommandHandle program, Action& action);
void add_nearest_command(CommandHandle program, Action& action);
void add_removed_command(CommandHandle program, Action& action);
void add_replay_command(CommandHandle program, Action& action);
void add_record_command(CommandHandle program, Action& action);
void add_watch_command(CommandHandle program, Action& action);
void add_watch_tiles_command(CommandHandle program, Action& action);
void add_query_command(CommandHandle program, Action& action);
void add_doctor_command(CommandHandle program, Action& action);
void add_security_command(CommandHandle program, Action& action);
void add_status_command(CommandHandle program, Action& action);
void add_health_command(CommandHandle program, Action& action);
void add_octomap_command(CommandHandle program, Action& action);
void add_discovery_server_command(CommandHandle program, Action& action);
void add_save_command(CommandHandle program, Action& action);
void add_load_command(CommandHandle program, Action& action);
void add_reset_command(CommandHandle program, Action& action);
void add_locate_command(CommandHandle program, Action& action);
void add_map_info_command(CommandHandle program, Action& action);
void add_merge_command(CommandHandle program, Action& action);
void add_sessions_command(CommandHandle program, Action& action);
void add_map_check_command(CommandHandle program, Action& action);
void add_map_diff_command(CommandHandle program, Action& action);
void add_map_export_command(CommandHandle program, Action& action);
void add_evaluate_command(CommandHandle program, Action& action);
void add_simulate_command(CommandHandle program, Action& action);
void add_simulate_training_command(CommandHandle program, Action& action);
void add_dataset_command(CommandHandle program, Action& action);
void add_model_command(CommandHandle program, Action& action);

// Subcommands of evaluate.
void add_evaluate_trajectory_command(CommandHandle evaluate, Action& action);
void add_evaluate_segmentation_command(CommandHandle evaluate, Action& action);
void add_evaluate_map_command(CommandHandle evaluate, Action& action);
void add_evaluate_traversable_command(CommandHandle evaluate, Action& action);
void add_evaluate_weightings_command(CommandHandle evaluate, Action& action);
void add_evaluate_drives_command(CommandHandle evaluate, Action& action);

// Subcommands of dataset.
void add_dataset_export_command(CommandHandle dataset, Action& action);
void add_dataset_aggregate_command(CommandHandle dataset, Action& action);
void add_dataset_scatter_command(CommandHandle dataset, Action& action);
void add_dataset_sensor_command(CommandHandle dataset, Action& action);

// Subcommands of model.
void add_model_info_command(CommandHandle model, Action& action);
void add_model_calibrate_command(CommandHandle model, Action& action);
void add_model_agree_command(CommandHandle model, Action& action);
void add_model_speed_command(CommandHandle model, Action& action);
void add_model_run_command(CommandHandle model, Action& action);

// Subcommands of security.
void add_security_init_command(CommandHandle security, Action& action);
void add_security_add_command(CommandHandle security, Action& action);
void add_security_check_command(CommandHandle security, Action& action);

/// Runs the action; an exception becomes a line on stderr and its exit code.
[[nodiscard]] ExitCode run_action(const Action& action);

/// Parses the command line, then runs `action`, which that may have set, unless help or version was
/// asked for. Returns the exit code of the program.
[[nodiscard]] int run_program(CommandLine& command_line, int argc, char** argv,
                              const Action& action);

}  // namespace stillmap::cli
