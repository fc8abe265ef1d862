#include <pthread.h>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <exception>
#include <iostream>
#include <memory>
#include <set>
#include <string>

#include "config/loaders/model_file.hpp"
#include "config/loaders/openmp_waits.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/process/standard_streams.hpp"
#include "core/process/stop_signals.hpp"
#include "core/segmentation/model_error.hpp"
#include "idl/dds/dds_error.hpp"
#include "idl/dds/dds_log.hpp"
#include "server/arguments.hpp"
#include "server/mapping/async_segmenter.hpp"
#include "server/monitoring/log.hpp"
#include "server/server.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/threads/thread_failure.hpp"

namespace {

constexpr int failed = 1;
constexpr int bad_input = 2;
constexpr int thread_failed = 3;

// How long a server of which a thread failed may take to save its map.
constexpr unsigned int save_after_failure_s = 60;

/// For units with Type=notify; does nothing elsewhere.
void notify_systemd(const char* state) {
  if (const int result = sd_notify(0, state); result < 0) {
    spdlog::warn("systemd was not notified of {}: {}", state, std::strerror(-result));
  }
}

std::string topics_of_scans(const stillmap::ServerConfig& config) {
  std::set<std::string> topics;
  for (const auto& lidar : config.lidars) topics.insert("rt/" + lidar.topic);
  if (topics.empty()) return "rt/" + config.topics.points;
  std::string text;
  for (const std::string& topic : topics) text += (text.empty() ? "" : ", ") + topic;
  return text;
}

std::unique_ptr<stillmap::Segmenter> open_labels(const stillmap::ServerConfig& config,
                                                 const stillmap::SensorModel& sensor,
                                                 const Eigen::Isometry3d& T_base_lidar) {
  const bool adaptive_width = stillmap::server::segmentation_budget(config).count() > 0;
  auto labels = stillmap::open_segmenter(config.labels, sensor, adaptive_width, T_base_lidar);
  if (const std::string details = labels->details(); !details.empty()) {
    spdlog::info("labels by {}: {}", labels->name(), details);
  }
  return labels;
}

/// Returns the exit code.
int serve(const stillmap::ServerConfig& config) {
  sigset_t signals = stillmap::block_stop_signals();
  stillmap::server::block_thread_failures(signals);
  // At a limit of file sizes, writing fails as on a full disk, instead of ending the server.
  static_cast<void>(std::signal(SIGXFSZ, SIG_IGN));
  // A reader of the log that ends first (tee) must not keep the map from being saved.
  static_cast<void>(std::signal(SIGPIPE, SIG_IGN));
  stillmap::server::start_tbb_workers();
  stillmap::server::Server server(
      config, [&](const stillmap::SensorModel& sensor, const Eigen::Isometry3d& T_base_lidar) {
        return open_labels(config, sensor, T_base_lidar);
      });
  if (!config.automatic_sensor.is_on) {
    const auto hint = stillmap::better_model(config.labels, config.mapper.sensor);
    if (!hint.empty()) spdlog::info("{}; labels.model chooses", hint);
  }
  spdlog::info("ready: scans from {}, domain {}", topics_of_scans(config), config.dds.domain_id);
  if (config.map.file.empty())
    spdlog::info("the map is not kept in a file: map.file is empty, and --map-file was not given");
  notify_systemd("READY=1");
  int signal = 0;
  sigwait(&signals, &signal);
  const bool has_failed = signal == stillmap::server::thread_failure_signal;
  // What is left of the server may hang: then the signal ends it, and systemd starts another.
  if (has_failed) ::alarm(save_after_failure_s);
  spdlog::info("stopping");
  notify_systemd("STOPPING=1");
  server.stop();
  return has_failed ? thread_failed : 0;
}

/// The same; trying again does not mend a map file that is none.
int serve_in_file(const stillmap::ServerConfig& config) {
  try {
    return serve(config);
  } catch (const stillmap::UnusableMapFileError& error) {
    spdlog::critical("{}", error.what());
    return bad_input;
  }
}

}  // namespace

int main(int argc, char** argv) {
  stillmap::open_missing_standard_streams();
  stillmap::shorten_openmp_waits(argv);
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
    return serve_in_file(*arguments.config);
  } catch (const stillmap::ConfigError& error) {
    spdlog::critical("{}", error.what());
    return bad_input;
  } catch (const stillmap::ModelError& error) {
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
