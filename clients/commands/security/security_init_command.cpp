#include <iostream>
#include <memory>

#include "clients/commands/command.hpp"
#include "clients/commands/security/authority_topic_names.hpp"
#include "idl/dds/security/authority.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string folder;
  dds::TopicNames names;
  int days = 365;
  int authority_days = 3650;
};

ExitCode run(const Arguments& arguments) {
  const dds::Authority authority = dds::Authority::make(arguments.folder, arguments.authority_days);
  save_topic_names(arguments.names, arguments.folder);
  const dds::Validity validity = dds::Validity::days_from_now(arguments.days);
  for (const dds::Role role :
       {dds::Role::server, dds::Role::sensor, dds::Role::planner, dds::Role::operator_of_server}) {
    const std::string role_name(name(role));
    std::cout << authority
                     .add(role_name, role_name, dds::access_of(role, arguments.names), validity)
                     .string()
              << "\n";
  }
  std::cout << "Each folder is one identity, valid until " << dds::to_text(validity.to)
            << ": copy it to where it is used, as\n  stillmap-server --security "
            << arguments.folder << "/server\n  stillmap status --security " << arguments.folder
            << "/planner\nKeep " << authority.key_file().string()
            << " away from all of them: who has it can make identities.\n";
  return ExitCode::ok;
}

}  // namespace

void add_security_init_command(CommandHandle security, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = security.command(
      "init", "Make an authority, and identities for server, sensor, planner and operator");
  command.option("FOLDER", arguments->folder, "Where to; must not have an authority").required();
  command.option("--points", arguments->names.points, "The sensor's topic").with_default();
  command
      .option("--odometry-prior", arguments->names.odometry_prior,
              "Topic of the odometry prior; empty: none")
      .with_default();
  command.option("--server", arguments->names.name_space, "First part of the server's topic names")
      .with_default();
  command.option("--days", arguments->days, "How long the identities are valid")
      .between(1, 36500)
      .with_default();
  command.option("--authority-days", arguments->authority_days, "How long the authority is valid")
      .between(1, 36500)
      .with_default();
  command.explain(
      "Example:\n"
      "  stillmap security init keys\n"
      "Topic names are part of the permissions: give those of the server's configuration.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
