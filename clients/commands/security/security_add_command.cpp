#include <iostream>
#include <memory>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "clients/commands/security/authority_topic_names.hpp"
#include "idl/dds/security/authority.hpp"
#include "idl/dds/security/identity.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string folder;
  std::string name;
  std::string role;
  int days = 365;
  bool replace = false;
};

// A replaced identity keeps its role.
dds::Role role_of(const Arguments& arguments) {
  std::string role = arguments.role;
  if (role.empty() && arguments.replace) {
    const auto file =
        dds::IdentityFiles(std::filesystem::path(arguments.folder) / arguments.name).certificate;
    role = dds::Certificate::read(file).role();
  }
  const auto known = dds::role_from_name(role);
  if (!known) {
    throw std::invalid_argument("--role '" + role + "' is none of " + dds::role_names());
  }
  return *known;
}

ExitCode run(const Arguments& arguments) {
  const dds::Authority authority = dds::Authority::open(arguments.folder);
  const dds::Role role = role_of(arguments);
  const dds::Validity validity = dds::Validity::days_from_now(arguments.days);
  const auto folder = authority.add(arguments.name, std::string(name(role)),
                                    dds::access_of(role, load_topic_names(arguments.folder)),
                                    validity, arguments.replace);
  std::cout << folder.string() << ": a " << name(role) << ", valid until "
            << dds::to_text(validity.to) << "\n";
  return ExitCode::ok;
}

}  // namespace

void add_security_add_command(CommandHandle security, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = security.command("add", "Make another identity, or one anew");
  command.option("FOLDER", arguments->folder, "The authority's folder").required();
  command.option("NAME", arguments->name, "Of the identity: a process, a robot, a person")
      .required();
  command.option("--role", arguments->role, "What it may do: " + dds::role_names());
  command.option("--days", arguments->days, "How long it is valid")
      .between(1, 36500)
      .with_default();
  command.flag("--replace", arguments->replace, "Make it anew where it exists, with its role");
  command.explain(
      "Examples:\n"
      "  stillmap security add keys planner_2 --role planner --days 30\n"
      "  stillmap security add keys server --replace           before it expires\n"
      "An identity cannot be called back before it expires: choose --days accordingly.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
