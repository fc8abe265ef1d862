#include "clients/commands/command.hpp"

namespace stillmap::cli {

void add_security_command(CommandHandle program, Action& action) {
  CommandHandle security = program.command(
      "security", "Make and check the certificates and permissions of a secured domain");
  security.require_command();
  add_security_init_command(security, action);
  add_security_add_command(security, action);
  add_security_check_command(security, action);
  security.explain(
      "An authority signs an identity for every process: a folder that is copied to where the\n"
      "process runs, and named there by --security FOLDER (or STILLMAP_SECURITY).\n"
      "'stillmap security STEP --help' shows options and examples.");
}

}  // namespace stillmap::cli
