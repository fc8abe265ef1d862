#include "clients/commands/command.hpp"

namespace stillmap::cli {

void add_dataset_command(CommandHandle program, Action& action) {
  CommandHandle dataset = program.command("dataset",
                                          "Make a labelled data set: export scans, label them as "
                                          "one cloud, take labels back; or find out "
                                          "a recording's sensor");
  dataset.require_command();
  add_dataset_export_command(dataset, action);
  add_dataset_aggregate_command(dataset, action);
  add_dataset_scatter_command(dataset, action);
  add_dataset_sensor_command(dataset, action);
  dataset.explain(
      "The way from a drive to a SemanticKITTI sequence with labels:\n"
      "  stillmap dataset export my_pcds campus --labels my_model   scans, poses, first guesses\n"
      "  stillmap dataset aggregate campus campus.ply               all scans in one cloud\n"
      "  ... correct the field 'label' in an editor, as CloudCompare ...\n"
      "  stillmap dataset scatter campus.ply campus                 labels back to every scan\n"
      "'stillmap dataset STEP --help' shows options and examples.");
}

}  // namespace stillmap::cli
