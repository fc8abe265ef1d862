#include <pthread.h>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include <csignal>
#include <cstring>
#include <exception>
#include <iostream>

#include "config/loaders/model_file.hpp"
#include "core/process/stop_signals.hpp"
#include "idl/dds/dds_error.hpp"
#include "idl/dds/dds_log.hpp"
#include "server/arguments.hpp"
#include "server/mapping/async_segmenter.hpp"
#include "server/monitoring/log.hpp"
#include "server/server.hpp"

namespace {

constexpr int failed = 1;
constexpr int bad_input = 2;

/// For units with Type=notify; does nothing elsewhere.
void notify_systemd(const char* state) {
  if (const int result = sd_notify(0, state); result < 0) {
    spdlog::warn("systemd was not notified of {}: {}", state, std::strerror(-result));
  }
}

void serve(const stillmap::ServerConfig& config) {
  const sigset_t signals = stillmap::block_stop_signals();
  // At a limit of file sizes, writing fails as on a full disk, instead of ending the server.
  static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
  const bool adaptive_width = stillmap::server::segmentation_budget(config).count() > 0;
  auto labels = stillmap::open_segmenter(config.labels, config.mapper.sensor, adaptive_width);
  if (const std::string details = labels->details(); !details.empty()) {
    spdlog::info("labels by {}: {}", labels->name(), details);
  }
  stillmap::server::Server server(config, std::move(labels));
  spdlog::info("ready: scans from rt/{}, domain {}", config.topics.points, config.dds.domain_id);
  notify_systemd("READY=1");
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping");
  notify_systemd("STOPPING=1");
  server.stop();
}

}  // namespace

int main(int argc, char** argv) {
  stillmap::server::start_log(stillmap::LogLevel::info);
  stillmap::dds::log_dds_to_stderr();
  try {
    const stillmap::server::Arguments arguments = stillmap::server::read_arguments(argc, argv);
    if (!arguments.config) {
      if (std::cout.flush()) return arguments.exit_code;
      spdlog::critical("the output cannot be written to stdout; is the disk full?");
      return failed;
    }
    stillmap::server::set_log_level(arguments.config->log.level);
    serve(*arguments.config);
    return 0;
  } catch (const stillmap::ConfigError& error) {
    spdlog::critical("{}", error.what());
    return bad_input;
  } catch (const stillmap::dds::SecurityError& error) {
    spdlog::critical("{}", error.what());
    return bad_input;
  } catch (const std::exception& error) {
    spdlog::critical("{}", error.what());
    return failed;
  }
}
