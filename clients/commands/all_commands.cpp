#include "clients/commands/command.hpp"

namespace stillmap::cli {
namespace {

constexpr const char* introduction =
    "Start here:\n"
    "  stillmap simulate city --scans 100         a sequence to try it with\n"
    "  stillmap map city --out city_map           map it in this process\n"
    "  stillmap replay city                       or send it to a running stillmap-server\n"
    "  stillmap query --around-robot 50           and ask that server for its map\n"
    "'stillmap COMMAND --help' shows a command's options and examples.\n"
    "Exit codes: 0 success; 1 the run failed; 2 wrong usage or input; 3 no server or no answer;\n"
    "4 'plan' found no path; 5 a drive or map was not recognised in another map.";

}  // namespace

void add_dataset_command(CommandHandle program, Action& action) {
  CommandHandle dataset = program.command("dataset",
                                          "Make a labelled data set: export scans, label them as "
                                          "one cloud, write the labels back; or find "
                                          "out the sensor of a data set");
  dataset.require_command();
  add_dataset_export_command(dataset, action);
  add_dataset_aggregate_command(dataset, action);
  add_dataset_scatter_command(dataset, action);
  add_dataset_sensor_command(dataset, action);
  dataset.explain(
      "From a bag to a SemanticKITTI sequence with labels:\n"
      "  stillmap dataset export my_pcds campus --labels my_model   scans, poses, first guesses\n"
      "  stillmap dataset aggregate campus campus.ply               all scans in one cloud\n"
      "  ... correct the field 'label' in an editor, as CloudCompare ...\n"
      "  stillmap dataset scatter campus.ply campus                 labels back to every scan\n"
      "'stillmap dataset STEP --help' shows options and examples.");
}

void add_evaluate_command(CommandHandle program, Action& action) {
  CommandHandle evaluate = program.command(
      "evaluate", "Compare trajectories, labels, maps or free areas with the truth");
  evaluate.require_command();
  add_evaluate_trajectory_command(evaluate, action);
  add_evaluate_segmentation_command(evaluate, action);
  add_evaluate_map_command(evaluate, action);
  add_evaluate_traversable_command(evaluate, action);
  add_evaluate_weightings_command(evaluate, action);
  add_evaluate_drives_command(evaluate, action);
  evaluate.explain("'stillmap evaluate WHAT --help' shows options and examples.");
}

void add_model_command(CommandHandle program, Action& action) {
  CommandHandle model = program.command(
      "model", "Look at a network, calibrate it for int8, compare and time its engines");
  model.require_command();
  add_model_info_command(model, action);
  add_model_calibrate_command(model, action);
  add_model_agree_command(model, action);
  add_model_speed_command(model, action);
  add_model_run_command(model, action);
  model.explain(
      "A model is a folder with model.onnx, model.yaml and, to run in int8, int8.yaml.\n"
      "'stillmap model STEP --help' shows options and examples.");
}

void add_commands(CommandHandle program, Action& action) {
  program.require_command();
  program.explain(introduction);
  add_map_command(program, action);
  add_localize_command(program, action);
  add_traversable_command(program, action);
  add_plan_command(program, action);
  add_check_path_command(program, action);
  add_nearest_command(program, action);
  add_removed_command(program, action);
  add_replay_command(program, action);
  add_record_command(program, action);
  add_watch_command(program, action);
  add_watch_tiles_command(program, action);
  add_query_command(program, action);
  add_octomap_command(program, action);
  add_status_command(program, action);
  add_health_command(program, action);
  add_discovery_server_command(program, action);
  add_security_command(program, action);
  add_doctor_command(program, action);
  add_save_command(program, action);
  add_load_command(program, action);
  add_reset_command(program, action);
  add_locate_command(program, action);
  add_map_info_command(program, action);
  add_merge_command(program, action);
  add_sessions_command(program, action);
  add_loops_command(program, action);
  add_map_check_command(program, action);
  add_map_diff_command(program, action);
  add_map_export_command(program, action);
  add_evaluate_command(program, action);
  add_simulate_command(program, action);
  add_simulate_training_command(program, action);
  add_dataset_command(program, action);
  add_model_command(program, action);
}

}  // namespace stillmap::cli
