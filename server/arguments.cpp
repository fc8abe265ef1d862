#include "server/arguments.hpp"

#include <CLI/CLI.hpp>
#include <iostream>
#include <map>
#include <string>

#include "config/listening_address.hpp"
#include "config/model_file.hpp"

namespace stillmap {
namespace {

constexpr const char* footer =
    "Scans come in as sensor_msgs/PointCloud2 on rt/points; poses, tiles, clouds and the status "
    "go\n"
    "out under rt/stillmap/, as ROS 2 topics.\n"
    "\n"
    "Examples:\n"
    "  stillmap-server                                    a 64-beam sensor, domain 0, map not "
    "kept\n"
    "  stillmap-server --config config/server/default.yaml --map-file city.stillmap\n"
    "  stillmap-server --delivery every                   for 'stillmap replay --lossless'\n"
    "  stillmap-server --check-config my_server.yaml      every fault of a file, or none\n"
    "Then, elsewhere: stillmap replay DATASET, stillmap watch, stillmap query, stillmap status.\n"
    "SIGINT and SIGTERM save the map and end the server with exit code 0.";

constexpr int bad_usage = 2;

std::map<std::string, LogLevel> log_levels() {
  return {{"debug", LogLevel::debug},
          {"info", LogLevel::info},
          {"warning", LogLevel::warning},
          {"error", LogLevel::error}};
}

std::string is_listening_address(const std::string& address) {
  return address.empty() ? "" : listening_address_fault(address);
}

/// Throws ConfigError with every fault, or ModelError.
Arguments check_config(const std::string& file) {
  const ServerConfig config = load_server_config(file);
  const auto labels = open_label_source(config.labels, config.mapper.sensor);
  std::cout << file << " can be used; labels by " << labels->name() << "\n";
  return {.config = std::nullopt};
}

}  // namespace

Arguments read_arguments(int argc, char** argv) {
  CLI::App program{"Turns lidar scans on DDS into poses and a queryable static semantic map.",
                   "stillmap-server"};
  program.set_version_flag("--version", std::string("stillmap-server ") + STILLMAP_VERSION);
  program.footer(footer);
  std::string config_file;
  std::optional<std::uint32_t> domain_id;
  std::optional<std::string> map_file;
  std::optional<Delivery> delivery;
  std::optional<LogLevel> log_level;
  std::optional<std::string> metrics_address;
  std::string checked_file;
  program.add_option("--config", config_file, "YAML file; config/server/default.yaml explains it")
      ->check(CLI::ExistingFile);
  program.add_option("--domain", domain_id, "DDS domain, instead of the file's")
      ->check(CLI::Range(0, 232));
  program.add_option("--map-file", map_file, "Where the map is kept, instead of the file's");
  program
      .add_option("--delivery", delivery,
                  "latest: drop scans that are too many; every: let the sender wait")
      ->option_text("latest|every")
      ->transform(CLI::CheckedTransformer(std::map<std::string, Delivery>{
          {"latest", Delivery::latest}, {"every", Delivery::every}}));
  program
      .add_option("--log-level", log_level, "Least important lines to log, instead of the file's")
      ->option_text("debug|info|warning|error")
      ->envname("STILLMAP_LOG_LEVEL")
      ->transform(CLI::CheckedTransformer(log_levels()));
  program
      .add_option("--metrics", metrics_address,
                  "ADDRESS:PORT for Prometheus's figures, instead of the file's; 127.0.0.1:9464")
      ->check(is_listening_address);
  program
      .add_option("--check-config", checked_file,
                  "Only say whether this file, and the model it names, can be used")
      ->check(CLI::ExistingFile);
  try {
    program.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return {.config = std::nullopt, .exit_code = program.exit(error) == 0 ? 0 : bad_usage};
  }
  if (!checked_file.empty()) return check_config(checked_file);
  ServerConfig config = config_file.empty() ? ServerConfig() : load_server_config(config_file);
  if (domain_id) config.dds.domain_id = *domain_id;
  if (map_file) config.map.file = *map_file;
  if (delivery) config.input.delivery = *delivery;
  if (log_level) config.log.level = *log_level;
  if (metrics_address) config.metrics.address = *metrics_address;
  return {.config = config};
}

}  // namespace stillmap
