#include <csignal>

#include "clients/commands/command.hpp"
#include "config/loaders/openmp_waits.hpp"
#include "core/process/standard_streams.hpp"
#include "idl/dds/dds_log.hpp"

int main(int argc, char** argv) {
  stillmap::open_missing_standard_streams();
  stillmap::shorten_openmp_waits(argv);
  stillmap::dds::log_dds_to_stderr();
  // At a limit of file sizes, writing fails as on a full disk, instead of ending the program.
  static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
  stillmap::cli::CommandLine command_line("stillmap", STILLMAP_VERSION,
                                          "Lidar scans in, poses and a static semantic map out.");
  stillmap::cli::Action action;
  stillmap::cli::add_commands(command_line.root(), action);
  return stillmap::cli::run_program(command_line, argc, argv, action);
}
