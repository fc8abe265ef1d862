#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "clients/commands/mapping/mapping_run.hpp"
#include "clients/library/client.hpp"
#include "clients/library/scan_publisher.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/dataset/scan_dataset.hpp"

namespace stillmap::cli {

struct ReplayOptions {
  ScanRange range;
  /// Times real time; 0: as fast as the server takes scans.
  double rate = 1.0;
  bool with_labels = true;
  /// How long a publisher that must not lose anything waits for the server to take a scan.
  std::chrono::milliseconds idle_timeout{30'000};
};

struct ReplayResult {
  std::vector<std::int64_t> published_stamps_ns;
  std::vector<SkippedScan> skipped;
  double seconds = 0.0;
  bool acknowledged = false;
  bool stopped = false;
};

/// Publishes the scans of a recording in their own rhythm. Throws ServiceTimeout when the server
/// stops taking scans, DatasetError as ScanRange says.
[[nodiscard]] ReplayResult replay_dataset(const ScanDataset& dataset, const ReplayOptions& options,
                                          ScanPublisher& publisher, StopSignal& stop,
                                          const ScanDone& scan_done,
                                          const ScanSkipped& scan_skipped);

/// What the server made of scans since an earlier status.
struct ServerCounts {
  std::uint64_t mapped = 0;
  std::uint64_t dropped = 0;
};
[[nodiscard]] ServerCounts counts_since(const dds::ServerStatus& before,
                                        const dds::ServerStatus& now);

/// Asks until the server has mapped or dropped `scans` of them since `before`, or nothing has
/// changed for `idle_timeout`. Returns the last status.
[[nodiscard]] dds::ServerStatus wait_until_mapped(Client& client, const dds::ServerStatus& before,
                                                  std::uint64_t scans,
                                                  std::chrono::milliseconds idle_timeout,
                                                  StopSignal& stop);

}  // namespace stillmap::cli
