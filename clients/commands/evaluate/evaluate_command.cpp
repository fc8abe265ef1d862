
#include "clients/commands/command.hpp"

namespace stillmap::cli {

void add_evaluate_command(CommandHandle program, Action& action) {
  CommandHandle evaluate = program.command(
      "evaluate", "Compare trajectories, labels, maps or free areas with the truth");
  evaluate.require_command();
  add_evaluate_trajectory_command(evaluate, action);
  add_evaluate_segmentation_command(evaluate, action);
  add_evaluate_map_command(evaluate, action);
  add_evaluate_traversable_command(evaluate, action);
  add_evaluate_weightings_command(evaluate, action);
  evaluate.explain("'stillmap evaluate WHAT --help' shows options and examples.");
}

}  // namespace stillmap::cli
