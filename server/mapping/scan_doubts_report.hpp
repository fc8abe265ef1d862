#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "core/lidar/other_axes.hpp"
#include "idl/interface/diagnostic.hpp"

namespace stillmap::server {

/// Says in the log and the status where the clouds of a topic seem to have other axes than ours, or
/// to be parts of a turn. Scans come from one thread; the rest is thread-safe.
class ScanDoubtsReport {
 public:
  /// Of axes nothing is said where the configuration tells how the lidar hangs.
  ScanDoubtsReport(std::string topic, bool is_mount_known);

  /// Takes the next scan of this lidar, in the lidar's frame, as it came.
  void add(const std::string& lidar, const Scan& scan);

  /// What is to be said now; empty: nothing.
  [[nodiscard]] std::vector<dds::Diagnostic> diagnostics() const;

 private:
  std::string topic_;
  bool is_mount_known_;
  std::map<std::string, ScanDoubts> of_lidars_;
  mutable std::mutex mutex_;
  /// By lidar.
  std::map<std::string, std::vector<dds::Diagnostic>> said_;
};

}  // namespace stillmap::server
