#include "server/arguments.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <system_error>
#include <vector>

#include "config/loaders/closest_name.hpp"
#include "config/loaders/listening_address.hpp"
#include "config/loaders/model_file.hpp"
#include "idl/dds/security/identity.hpp"

namespace stillmap::server {
namespace {

constexpr const char* footer =
    "Scans come in as sensor_msgs/PointCloud2 on rt/points; poses, tiles, clouds and the status\n"
    "go out under rt/stillmap/, as ROS 2 topics.\n"
    "\n"
    "Examples:\n"
    "  stillmap-server                                   any one lidar, domain 0, map not kept\n"
    "  stillmap-server --config config/server/default.yaml --map-file city.stillmap\n"
    "  stillmap-server --delivery every                  for 'stillmap replay --lossless'\n"
    "  stillmap-server --check-config my_server.yaml     every fault of a file, or none\n"
    "Then, elsewhere: stillmap replay DATASET, stillmap watch, stillmap query, stillmap status.\n"
    "SIGINT, SIGTERM and SIGHUP save the map and end the server with exit code 0.";

constexpr int bad_usage = 2;

/// One of a few words; `variable` may give it, too.
template <typename T>
CLI::Option* add_choice(CLI::App& program, const std::string& name, std::optional<T>& value,
                        const std::map<std::string, T>& choices, const std::string& help,
                        const std::string& variable = "") {
  std::string words;
  for (const auto& choice : choices) words += (words.empty() ? "" : "|") + choice.first;
  const auto choose = [=, &value](const std::string& word) {
    const auto found = choices.find(word);
    if (found != choices.end()) {
      value = found->second;
      return;
    }
    throw CLI::ValidationError(name + (variable.empty() ? "" : " or " + variable),
                               "'" + word + "' is none of " + words);
  };
  return program.add_option_function<std::string>(name, choose, help)
      ->option_text(words)
      ->envname(variable);
}

/// Options for logs and metrics, which override the configuration file.
struct OperationArguments {
  std::optional<LogLevel> log_level;
  std::optional<std::string> metrics_address;

  void apply_to(ServerConfig& config) const {
    if (log_level) config.log.level = *log_level;
    if (metrics_address) config.metrics.address = *metrics_address;
  }
};

void add_operation_options(CLI::App& program, OperationArguments& operation) {
  add_choice<LogLevel>(program, "--log-level", operation.log_level,
                       {{"debug", LogLevel::debug},
                        {"info", LogLevel::info},
                        {"warning", LogLevel::warning},
                        {"error", LogLevel::error}},
                       "Least important lines to log, instead of the file's", "STILLMAP_LOG_LEVEL");
  program
      .add_option("--metrics", operation.metrics_address,
                  "Where Prometheus finds the metrics, instead of the file's; 127.0.0.1:9464")
      ->option_text("ADDRESS:PORT")
      ->check(listening_address_fault);
}

/// What would keep the server from its map file on this machine; the file may be meant for another,
/// and where the server runs as a service, that may make the folder.
void warn_of_map_folder(const ServerConfig& config) {
  if (config.map.file.empty()) return;
  const std::filesystem::path folder = std::filesystem::absolute(config.map.file).parent_path();
  std::error_code unknown;
  const std::filesystem::file_type type = std::filesystem::status(folder, unknown).type();
  if (type == std::filesystem::file_type::not_found) {
    std::cerr << "map.file: the folder " << folder.string()
              << " is not there yet: the server needs it when it starts (the installed service "
                 "makes its own); is a disk not mounted?\n";
  } else if (!unknown && type != std::filesystem::file_type::directory) {
    std::cerr << "map.file: " << folder.string() << " is no folder\n";
  }
}

/// Throws ConfigError with every fault, ModelError or SecurityError.
Arguments check_config(const std::string& file) {
  ConfigReport report;
  const ServerConfig config = load_server_config(file, report);
  const auto labels =
      open_segmenter(config.labels, config.mapper.sensor, true, config.mount.T_base_lidar);
  if (!config.dds.security.empty()) {
    static_cast<void>(dds::load_identity(config.dds.security));
    for (const std::string& warning :
         dds::check_identity(config.dds.security, std::chrono::floor<std::chrono::seconds>(
                                                      std::chrono::system_clock::now()))
             .warnings)
      std::cerr << warning << "\n";
  }
  warn_of_map_folder(config);
  std::cout << file << " can be used; labels by " << labels->name() << "\n";
  if (report.changed.empty()) std::cout << "all is as by default\n";
  for (const std::string& field : report.changed) std::cout << "not the default: " << field << "\n";
  return {.config = std::nullopt};
}

/// Options for the network, which override the configuration file.
struct NetworkArguments {
  std::optional<std::string> profile;
  std::vector<std::string> peers;
  std::optional<std::string> discovery_server;

  void apply_to(DdsNetworkConfig& network) const {
    if (profile) network.profile = *profile;
    if (!peers.empty()) network.peers = peers;
    if (discovery_server) network.discovery_server = *discovery_server;
    static_cast<void>(dds_options(network, DdsRole::server));
  }
};

void add_network_options(CLI::App& program, NetworkArguments& network) {
  program
      .add_option("--dds-profile", network.profile,
                  "Kind of network, instead of the file's: host, lan, wifi, wan, no_multicast, or "
                  "a profile's file")
      ->envname("STILLMAP_DDS_PROFILE");
  program
      .add_option("--peer", network.peers,
                  "Where to look for other processes, as HOST or HOST:PORT, without multicast")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->envname("STILLMAP_PEERS");
  program
      .add_option("--discovery-server", network.discovery_server,
                  "Find everybody through the discovery server at HOST or HOST:PORT")
      ->envname("STILLMAP_DISCOVERY_SERVER");
}

/// Options for the map, the input and the domain, which override the configuration file.
struct ServerArguments {
  std::optional<std::uint32_t> domain_id;
  std::optional<std::string> security;
  std::optional<std::string> map_file;
  std::optional<DeliveryMode> delivery;

  void apply_to(ServerConfig& config) const {
    if (domain_id) config.dds.domain_id = *domain_id;
    if (security) config.dds.security = *security;
    if (map_file) config.map.file = *map_file;
    if (delivery) config.input.delivery = *delivery;
  }
};

void add_server_options(CLI::App& program, ServerArguments& server) {
  program.add_option("--domain", server.domain_id, "DDS domain, instead of the file's")
      ->envname("ROS_DOMAIN_ID")
      ->check(CLI::Range(std::uint32_t{0}, dds::max_domain_id));
  program
      .add_option("--security", server.security,
                  "Folder of the server's identity in a secured domain, instead of the file's")
      ->envname("STILLMAP_SECURITY");
  program.add_option("--map-file", server.map_file, "Where the map is kept, instead of the file's")
      ->check([](const std::string& name) {
        // As of a variable that is not set: who names a file wants the map kept.
        return name.empty() ? "is empty; name a file, or leave the option out" : std::string();
      });
  add_choice<DeliveryMode>(program, "--delivery", server.delivery,
                           {{"latest", DeliveryMode::latest}, {"every", DeliveryMode::every}},
                           "latest: drop scans that are too many; every: let the sender wait");
}

/// What CLI11 says, but of words that mean nothing, which it names last first.
std::string describe_fault(const CLI::App* program, const CLI::Error& fault) {
  const bool are_unknown = fault.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError);
  return (are_unknown ? "not expected here: " + CLI::detail::join(program->remaining(), " ")
                      : std::string(fault.what())) +
         "\nRun with --help for more information.\n";
}

/// The first option that does not exist but is written much as one that does: that one.
std::string meant_option(const CLI::App& program, std::span<char* const> words) {
  std::vector<std::string> known;
  for (const CLI::Option* option : program.get_options())
    std::ranges::copy(option->get_lnames(), std::back_inserter(known));
  for (const std::string word : words) {
    const std::string name = word.substr(0, word.find('='));
    if (!name.starts_with("--") || program.get_option_no_throw(name) != nullptr) continue;
    if (const std::string meant = closest_name(name.substr(2), known); !meant.empty())
      return "--" + meant;
  }
  return {};
}

}  // namespace

Arguments read_arguments(int argc, char** argv) {
  CLI::App program{"Turns lidar scans on DDS into poses and a queryable static semantic map.",
                   "stillmap-server"};
  program.set_version_flag("--version", std::string("stillmap-server ") + STILLMAP_VERSION);
  program.footer(footer);
  program.failure_message(describe_fault);
  std::string config_file;
  std::string checked_file;
  ServerArguments server;
  NetworkArguments network;
  OperationArguments operation;
  program.add_option("--config", config_file, "YAML file; config/server/default.yaml explains it")
      ->check(CLI::ExistingFile);
  add_server_options(program, server);
  add_network_options(program, network);
  add_operation_options(program, operation);
  program
      .add_option("--check-config", checked_file,
                  "Only say whether this file, and the model it names, can be used")
      ->check(CLI::ExistingFile);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (program.exit(error) == 0) return {.config = std::nullopt, .exit_code = 0};
    const std::string meant =
        meant_option(program, std::span(argv, static_cast<std::size_t>(argc)));
    if (!meant.empty()) std::cerr << "Did you mean '" << meant << "'?\n";
    return {.config = std::nullopt, .exit_code = bad_usage};
  }
  if (!checked_file.empty()) return check_config(checked_file);
  ServerConfig config = config_file.empty() ? ServerConfig() : load_server_config(config_file);
  server.apply_to(config);
  network.apply_to(config.dds.network);
  operation.apply_to(config);
  return {.config = config};
}

}  // namespace stillmap::server
