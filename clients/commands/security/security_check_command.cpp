#include <sys/stat.h>

#include <filesystem>
#include <iostream>
#include <memory>

#include "clients/commands/command.hpp"
#include "idl/dds/security/authority.hpp"
#include "idl/dds/security/identity.hpp"

namespace stillmap::cli {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::string folder;
};

bool is_fault_free(const fs::path& identity) {
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const dds::IdentityFaults found = dds::check_identity(identity, now);
  if (found.faults.empty() && found.warnings.empty()) {
    const dds::Certificate certificate =
        dds::Certificate::read(dds::IdentityFiles(identity).certificate);
    std::cout << identity.string() << ": well; " << certificate.role() << " '" << certificate.name()
              << "', valid until " << dds::to_text(certificate.validity().to) << "\n";
    return true;
  }
  for (const std::string& fault : found.faults) std::cout << "FAULT   " << fault << "\n";
  for (const std::string& warning : found.warnings) std::cout << "WARNING " << warning << "\n";
  return false;
}

bool is_key_hidden(const dds::Authority& authority) {
  struct stat facts {};
  const fs::path file = authority.key_file();
  const bool is_hidden =
      ::stat(file.c_str(), &facts) == 0 && (facts.st_mode & (S_IRWXG | S_IRWXO)) == 0;
  if (!is_hidden) {
    std::cout << "FAULT   " << file.string()
              << " can be read by other users, who could make identities: chmod 600 "
              << file.string() << "\n";
  }
  return is_hidden;
}

bool is_of_authority(const fs::path& identity, const dds::Authority& authority) {
  const fs::path file = dds::IdentityFiles(identity).certificate;
  if (!fs::exists(file) || dds::Certificate::read(file).is_signed_by(authority.certificate())) {
    return true;
  }
  std::cout << "FAULT   " << file.string() << " was not issued by the authority of this folder\n";
  return false;
}

ExitCode run(const Arguments& arguments) {
  const fs::path folder = arguments.folder;
  if (!fs::exists(folder / "authority")) {
    return is_fault_free(folder) ? ExitCode::ok : ExitCode::failed;
  }
  const dds::Authority authority = dds::Authority::open(folder);
  bool all_well = is_key_hidden(authority);
  for (const fs::path& identity : authority.identities()) {
    all_well = is_fault_free(identity) && all_well;
    all_well = is_of_authority(identity, authority) && all_well;
  }
  return all_well ? ExitCode::ok : ExitCode::failed;
}

}  // namespace

void add_security_check_command(CommandHandle security, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command =
      security.command("check", "Say what is wrong with an identity, or with all of a folder");
  command.option("FOLDER", arguments->folder, "Of one identity, or the authority's").required();
  command.explain(
      "Examples:\n"
      "  stillmap security check keys\n"
      "  stillmap security check /etc/stillmap/server\n"
      "Expired or mixed files, keys that others can read, permissions of somebody else.\n"
      "Exit codes: 0 well, 1 something was found.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
