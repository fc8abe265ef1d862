#include <chrono>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/gateway/gateway.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "config/loaders/listening_address.hpp"
#include "config/loaders/topic_name.hpp"
#include "core/process/standard_streams.hpp"
#include "idl/dds/dds_log.hpp"

namespace {

using stillmap::cli::ExitCode;
namespace gateway = stillmap::gateway;

struct Arguments {
  stillmap::cli::ClientArguments client;
  gateway::GatewayOptions gateway;
  std::string listen = "127.0.0.1:8765";
  std::string token_file;
  std::string tls_certificate;
  std::string tls_key;
  std::string page;
  bool no_page = false;
  bool trust_network = false;
  bool local_names = false;
};

constexpr std::chrono::milliseconds stop_check_period{100};
constexpr std::size_t min_token_length = 16;

std::string token_in(const std::string& file) {
  std::ifstream stream(file);
  std::string token;
  if (!(stream >> token)) {
    throw std::invalid_argument("--token-file '" + file +
                                "' has no token: write one with 'openssl "
                                "rand -hex 16'");
  }
  const bool is_plain = token.find_first_not_of(
                            "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ_abcdefghijkl"
                            "mnopqrstuvwxyz-") == std::string::npos;
  if (token.size() < min_token_length || !is_plain) {
    throw std::invalid_argument("the token in '" + file +
                                "' must be at least 16 letters, digits, "
                                "'-' or '_': 'openssl rand -hex 16' writes one");
  }
  return token;
}

/// Whoever reaches the port can read the map, and with --control change it.
void require_protection(const Arguments& arguments) {
  if (gateway::is_local_address(arguments.listen) || arguments.trust_network) return;
  if (!arguments.token_file.empty() && !arguments.tls_certificate.empty()) return;
  throw std::invalid_argument(
      "--listen " + arguments.listen +
      " is reached from other machines: give --tls-certificate, --tls-key and --token-file; or "
      "--trust-network where something else guards the port, as the port mapping of a container or "
      "a proxy");
}

gateway::WebServerOptions web_options(const Arguments& arguments) {
  if (const std::string fault = stillmap::listening_address_fault(arguments.listen);
      !fault.empty()) {
    throw std::invalid_argument("--listen: " + fault);
  }
  require_protection(arguments);
  if (arguments.tls_certificate.empty() != arguments.tls_key.empty()) {
    throw std::invalid_argument("--tls-certificate and --tls-key are given together or not at all");
  }
  gateway::WebServerOptions web = arguments.gateway.web;
  web.address = arguments.listen;
  web.access.local_only = arguments.local_names || gateway::is_local_address(arguments.listen);
  if (!arguments.token_file.empty()) web.access.token = token_in(arguments.token_file);
  web.tls = {.certificate = arguments.tls_certificate, .key = arguments.tls_key};
  return web;
}

/// Without one given, that which was built or installed with the program.
std::filesystem::path page_folder(const Arguments& arguments) {
  if (arguments.no_page) return {};
  if (!arguments.page.empty()) return arguments.page;
  std::error_code none;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", none);
  return program.parent_path().parent_path() / "share/stillmap/web";
}

gateway::GatewayOptions gateway_options(const Arguments& arguments) {
  gateway::GatewayOptions options = arguments.gateway;
  options.dds = arguments.client.dds(stillmap::DdsRole::client);
  options.dds.participant_name = "stillmap-gateway";
  options.topics.server_name = arguments.client.server_name;
  options.services.server_name = arguments.client.server_name;
  options.services.timeout = arguments.client.timeout();
  options.web = web_options(arguments);
  options.page = page_folder(arguments);
  return options;
}

void print_addresses(const gateway::GatewayOptions& options, std::uint16_t port) {
  const bool over_tls = !options.web.tls.certificate.empty();
  const std::string& address = options.web.address;
  std::string host = options.web.access.local_only ? "localhost" : "HOST";
  if (gateway::is_local_address(address)) host = address.substr(0, address.rfind(':'));
  host.append(":").append(std::to_string(port)).append("/");
  if (!options.web.access.token.empty()) host += "?token=" + options.web.access.token;
  if (!options.page.empty()) std::cout << (over_tls ? "https://" : "http://") << host << "\n";
  std::cout << (over_tls ? "wss://" : "ws://") << host << " (Foxglove, Lichtblick)" << std::endl;
}

ExitCode run(const Arguments& arguments) {
  stillmap::cli::StopSignal stop;
  const gateway::GatewayOptions options = gateway_options(arguments);
  gateway::Gateway server(options);
  print_addresses(options, server.port());
  while (!stop.requested()) server.run_for(stop_check_period);
  return ExitCode::ok;
}

void add_options(stillmap::cli::CommandHandle command, Arguments& arguments) {
  command
      .option("--listen", arguments.listen, "Address and port for browsers; port 0: any free one")
      .with_default();
  command.option("--tls-certificate", arguments.tls_certificate,
                 "Certificate chain (PEM): https and wss");
  command.option("--tls-key", arguments.tls_key, "Its key (PEM)");
  command.option("--token-file", arguments.token_file,
                 "Ask clients for the token in this file: ?token=TOKEN or 'Authorization: Bearer'");
  command.flag("--trust-network", arguments.trust_network,
               "Listen to other machines without TLS and token");
  command.flag(
      "--local-names", arguments.local_names,
      "Answer as localhost and 127.0.0.1 only, whatever it listens on: for a container's port "
      "that is mapped to this machine");
  command
      .option("--origin", arguments.gateway.web.access.origins,
              "HOST or HOST:PORT of another page that may connect, beside app.foxglove.dev and "
              "pages of this machine")
      .one_at_a_time();
  command.flag("--control", arguments.gateway.services.with_control,
               "Offer the services that change, save or replace the map, too");
  const stillmap::cli::OptionHandle page = command.option(
      "--page", arguments.page, "Folder of the page, instead of the one that came along");
  command.flag("--no-page", arguments.no_page, "Foxglove's protocol only").excludes(page);
  const auto add_topic = [&](const char* option, std::string& topic, const char* whose) {
    command.option(option, topic, std::string(whose) + " topic")
        .corrected(stillmap::to_topic_name)
        .with_default();
  };
  add_topic("--points", arguments.gateway.topics.points, "The sensor's");
  add_topic("--odometry", arguments.gateway.topics.odometry_prior, "The odometry prior's");
  add_topic("--imu", arguments.gateway.topics.imu, "The IMU's");
  add_topic("--gnss", arguments.gateway.topics.gnss, "A GNSS receiver's");
  stillmap::cli::add_client_options(command, arguments.client);
  command.explain(
      "Examples:\n"
      "  stillmap-gateway                         # then open http://127.0.0.1:8765/\n"
      "  stillmap-gateway --dds-profile wifi --peer 10.0.0.5\n"
      "  openssl rand -hex 16 > token\n"
      "  stillmap-gateway --listen 0.0.0.0:8765 --token-file token --tls-certificate host.pem \\\n"
      "      --tls-key host.key\n"
      "A client of the server like any other: it may run on another machine. Lichtblick and "
      "Foxglove connect as 'Foxglove WebSocket' with the address that it prints. A client that is "
      "slower than the data gets the newest of it, small messages before large ones, and is told "
      "what it missed; http://127.0.0.1:8765/gateway.json counts it.");
}

}  // namespace

int main(int argc, char** argv) {
  stillmap::open_missing_standard_streams();
  stillmap::dds::log_dds_to_stderr();
  Arguments arguments;
  stillmap::cli::CommandLine command_line(
      "stillmap-gateway", STILLMAP_VERSION,
      "A server's map, poses and scans in browsers: a page of its own, Foxglove and Lichtblick.");
  add_options(command_line.root(), arguments);
  return stillmap::cli::run_program(command_line, argc, argv, [&] { return run(arguments); });
}
