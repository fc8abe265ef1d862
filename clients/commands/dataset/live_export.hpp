#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>

#include "clients/commands/dataset/sequence_output.hpp"
#include "clients/library/client.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "config/loaders/server_config.hpp"

namespace stillmap::cli {

struct LiveExportOptions {
  /// ROS 2 name of the sensor's topic.
  std::string topic;
  /// End after as many scans.
  std::size_t scans = SIZE_MAX;
  /// End when nothing has come for so long; the first scan may take longer.
  std::chrono::milliseconds silence{10'000};
};

/// Writes what a running server gets and makes of it as a SemanticKITTI sequence: the sensor's
/// scans as they come, the server's poses and, as a first guess, its labels. `config` is the
/// server's: which points it keeps, how it reads the sensor's fields. Ends with the signal, enough
/// scans, or silence. `scan_done(scans so far)`. Throws DatasetError.
[[nodiscard]] ExportSummary export_live(Client& client, const LiveExportOptions& options,
                                        const ServerConfig& config,
                                        const std::filesystem::path& folder, StopSignal& stop,
                                        const std::function<void(std::size_t)>& scan_done);

}  // namespace stillmap::cli
