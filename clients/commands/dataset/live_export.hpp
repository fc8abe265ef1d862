#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clients/commands/dataset/sequence_export.hpp"
#include "clients/library/client.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "config/loaders/server_config.hpp"
#include "core/lidar/scan.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap::cli {

/// A scan of the sensor with what the server made of it.
struct LiveScan {
  Scan scan;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Of the usable points; nothing when the server's labelled scan was lost on its way.
  std::optional<std::vector<SemanticClass>> classes;
};

/// Brings together by their stamps what arrives on three topics: scans, poses, labels.
class LiveScanSynchronizer {
 public:
  void add_scan(const Scan& scan);
  void add_pose(const StampedPose& pose);
  void add_labels(std::int64_t stamp_ns, std::vector<SemanticClass> classes);

  /// The next scan, oldest first, when all of it is there or will not come any more.
  [[nodiscard]] std::optional<LiveScan> take();
  /// The same at the end, when nothing more comes.
  [[nodiscard]] std::optional<LiveScan> take_last();

  /// Scans that the server did not map: there is a pose of a later one.
  [[nodiscard]] std::size_t without_pose() const { return without_pose_; }

 private:
  /// Poses of so many later scans say that a scan's labels are lost: they are sent best effort.
  static constexpr std::size_t max_label_delay_scans = 10;
  /// More scans do not wait for a server that is gone.
  static constexpr std::size_t max_waiting = 200;

  [[nodiscard]] std::optional<LiveScan> take_if(bool all_arrived);

  std::deque<Scan> waiting_;
  std::map<std::int64_t, Eigen::Isometry3d> T_map_lidar_;
  std::map<std::int64_t, std::vector<SemanticClass>> classes_;
  std::size_t without_pose_ = 0;
};

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
