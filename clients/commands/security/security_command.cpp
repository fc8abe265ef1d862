#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>
#include <vector>

#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "config/loaders/topic_name.hpp"
#include "idl/dds/dds_error.hpp"
#include "idl/dds/security/authority.hpp"
#include "idl/dds/security/identity.hpp"
#include "idl/interface/roles.hpp"

namespace stillmap::cli {
namespace {

std::filesystem::path file_in(const std::filesystem::path& authority_folder) {
  return authority_folder / "authority" / "topics.json";
}

/// One topic as a text, as it was before there could be several.
Json json_of_points(const std::vector<std::string>& points) {
  return points.size() == 1 ? Json(points.front()) : Json(points);
}

/// Throws nlohmann's errors.
std::vector<std::string> points_from(const nlohmann::json& json) {
  if (json.is_string()) return {json.get<std::string>()};
  return json.get<std::vector<std::string>>();
}

/// Saves the topic names of an authority's permissions beside its key, so that later identities get
/// the same ones. Throws SecurityError when the file cannot be written.
void save_topic_names(const dds::TopicNames& names, const std::filesystem::path& authority_folder) {
  const std::filesystem::path file = file_in(authority_folder);
  std::ofstream out(file);
  out << Json{{"points", json_of_points(names.points)},
              {"odometry_prior", names.odometry_prior},
              {"imu", names.imu},
              {"gnss", names.gnss},
              {"initial_pose", names.initial_pose},
              {"namespace", names.name_space}}
             .dump(2)
      << "\n";
  out.close();
  if (!out) throw dds::SecurityError(file.string() + " cannot be written");
}

dds::SecurityError unusable(const std::filesystem::path& file, const std::string& why) {
  return dds::SecurityError(file.string() + " does not name the topics (" + why +
                            "); restore it, or make a new authority");
}

/// Throws SecurityError for a file that is damaged or not there.
dds::TopicNames load_topic_names(const std::filesystem::path& authority_folder) {
  const std::filesystem::path file = file_in(authority_folder);
  std::ifstream in(file);
  try {
    const auto json = nlohmann::json::parse(in);
    dds::TopicNames names{.points = points_from(json.at("points")),
                          .odometry_prior = json.at("odometry_prior"),
                          .imu = json.value("imu", std::string()),
                          .gnss = json.value("gnss", std::string()),
                          .initial_pose = json.value("initial_pose", std::string()),
                          .name_space = json.at("namespace")};
    const std::string fault = topic_list_fault(names.points);
    if (!fault.empty()) throw unusable(file, "'points' " + fault);
    return names;
  } catch (const nlohmann::json::exception& error) {
    throw unusable(file, error.what());
  }
}

struct InitArguments {
  std::string folder;
  dds::TopicNames names;
  int days = 365;
  int authority_days = 3650;
};

/// Folders that go again unless all that belongs together could be made.
class UnfinishedFolders {
 public:
  UnfinishedFolders() = default;
  ~UnfinishedFolders() {
    std::error_code ignored;
    for (const auto& folder : folders_) std::filesystem::remove_all(folder, ignored);
  }
  UnfinishedFolders(const UnfinishedFolders&) = delete;
  UnfinishedFolders& operator=(const UnfinishedFolders&) = delete;

  void add(const std::filesystem::path& folder) { folders_.push_back(folder); }
  void keep() { folders_.clear(); }

 private:
  std::vector<std::filesystem::path> folders_;
};

ExitCode run(const InitArguments& arguments) {
  const std::string fault = topic_list_fault(arguments.names.points);
  if (!fault.empty()) throw std::invalid_argument("--points " + fault);
  UnfinishedFolders unfinished;
  if (!std::filesystem::exists(arguments.folder)) unfinished.add(arguments.folder);
  const dds::Authority authority = dds::Authority::make(arguments.folder, arguments.authority_days);
  unfinished.add(authority.key_file().parent_path());
  save_topic_names(arguments.names, arguments.folder);
  const dds::Validity validity = dds::Validity::days_from_now(arguments.days);
  std::string made;
  for (const dds::Role role :
       {dds::Role::server, dds::Role::sensor, dds::Role::planner, dds::Role::operator_of_server}) {
    const std::string role_name(name(role));
    const std::filesystem::path identity =
        authority.add(role_name, role_name, dds::access_of(role, arguments.names), validity);
    unfinished.add(identity);
    made += identity.string() + "\n";
  }
  unfinished.keep();
  std::cout << made << "Each folder is one identity, valid until " << dds::to_text(validity.to)
            << ": copy it to where it is used, as\n  stillmap-server --security "
            << arguments.folder << "/server\n  stillmap status --security " << arguments.folder
            << "/planner\nKeep " << authority.key_file().string()
            << " away from all of them: who has it can make identities.\n";
  return ExitCode::ok;
}

struct AddArguments {
  std::string folder;
  std::string name;
  std::string role;
  int days = 365;
  bool replace = false;
};

// A replaced identity keeps its role.
dds::Role role_of(const AddArguments& arguments) {
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

ExitCode run(const AddArguments& arguments) {
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

namespace fs = std::filesystem;

struct CheckArguments {
  std::string folder;
};

bool is_fault_free(const fs::path& identity) {
  const auto now = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());
  const dds::IdentityFaults found = dds::check_identity(identity, now);
  if (found.faults.empty() && found.warnings.empty()) {
    const dds::Certificate certificate =
        dds::Certificate::read(dds::IdentityFiles(identity).certificate);
    std::cout << identity.string() << ": ok; " << certificate.role() << " '" << certificate.name()
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

/// Also for a certificate that cannot be read, which is_fault_free() tells of.
bool is_of_authority(const fs::path& identity, const dds::Authority& authority) {
  const fs::path file = dds::IdentityFiles(identity).certificate;
  try {
    if (dds::Certificate::read(file).is_signed_by(authority.certificate())) return true;
  } catch (const dds::SecurityError&) {
    return true;
  }
  std::cout << "FAULT   " << file.string() << " was not issued by the authority of this folder\n";
  return false;
}

ExitCode run(const CheckArguments& arguments) {
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

void add_security_init_command(CommandHandle security, Action& action) {
  auto arguments = std::make_shared<InitArguments>();
  CommandHandle command = security.command(
      "init", "Make an authority, and identities for server, sensor, planner and operator");
  command.option("FOLDER", arguments->folder, "Where to; must not have an authority").required();
  command
      .option("--points", arguments->names.points,
              "The sensor's topic; of several lidars, each one's")
      .corrected(to_topic_name)
      .with_default();
  command
      .option("--odometry-prior", arguments->names.odometry_prior,
              "Topic of the odometry prior; empty: none")
      .corrected(to_topic_name_or_empty)
      .or_empty()
      .with_default();
  command.option("--imu", arguments->names.imu, "Topic of the IMU; empty: none")
      .corrected(to_topic_name_or_empty)
      .or_empty()
      .with_default();
  command.option("--gnss", arguments->names.gnss, "Topic of a GNSS receiver; empty: none")
      .corrected(to_topic_name_or_empty)
      .or_empty()
      .with_default();
  command
      .option("--initial-pose", arguments->names.initial_pose,
              "Topic on which operators say where the robot is; empty: none")
      .corrected(to_topic_name_or_empty)
      .or_empty()
      .with_default();
  command.option("--server", arguments->names.name_space, "First part of the server's topic names")
      .corrected(to_topic_name)
      .with_default();
  command.option("--days", arguments->days, "How long the identities are valid")
      .between(1, 36500)
      .with_default();
  command.option("--authority-days", arguments->authority_days, "How long the authority is valid")
      .between(1, 36500)
      .with_default();
  command.explain(
      "Examples:\n"
      "  stillmap security init keys\n"
      "  stillmap security init keys --points front/points rear/points     # several lidars\n"
      "Topic names are part of the permissions: give those of the server's configuration.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_security_add_command(CommandHandle security, Action& action) {
  auto arguments = std::make_shared<AddArguments>();
  CommandHandle command = security.command("add", "Make another identity, or replace one");
  command.option("FOLDER", arguments->folder, "The authority's folder").required();
  command.option("NAME", arguments->name, "Of the identity: a process, a robot, a person")
      .required();
  command.option("--role", arguments->role, "What it may do: " + dds::role_names());
  command.option("--days", arguments->days, "How long it is valid")
      .between(1, 36500)
      .with_default();
  command.flag("--replace", arguments->replace, "Replace an identity that exists, with its role");
  command.explain(
      "Examples:\n"
      "  stillmap security add keys planner_2 --role planner --days 30\n"
      "  stillmap security add keys server --replace           before it expires\n"
      "An identity cannot be called back before it expires: choose --days accordingly.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

void add_security_check_command(CommandHandle security, Action& action) {
  auto arguments = std::make_shared<CheckArguments>();
  CommandHandle command =
      security.command("check", "Say what is wrong with an identity, or with all of a folder");
  command.option("FOLDER", arguments->folder, "Of one identity, or the authority's").required();
  command.explain(
      "Examples:\n"
      "  stillmap security check keys\n"
      "  stillmap security check /etc/stillmap/server\n"
      "Expired or mixed files, keys that others can read, permissions of somebody else.\n"
      "Exit codes: 0 no fault, 1 something was found.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

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
