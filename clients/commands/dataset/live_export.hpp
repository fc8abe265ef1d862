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
#include "core/lidar/prepare.hpp"
#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_fit.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap::cli {

/// A scan of the sensor with the pose and labels that the server published for it.
struct LiveScan {
  Scan scan;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Of the usable points; nothing when the server's labelled scan was lost on its way.
  std::optional<std::vector<SemanticClass>> classes;
};

/// Joins scans, poses and labels, which arrive on three topics, by their stamps.
class LiveScanSynchronizer {
 public:
  void add_scan(const Scan& scan);
  void add_pose(const StampedPose& pose);
  void add_labels(std::int64_t stamp_ns, std::vector<SemanticClass> classes);

  /// The next complete scan, oldest first; also one whose labels are lost.
  [[nodiscard]] std::optional<LiveScan> take();
  /// The same at the end of the stream: waits for nothing more.
  [[nodiscard]] std::optional<LiveScan> take_last();

  /// Scans that the server did not map: a later scan has a pose.
  [[nodiscard]] std::size_t without_pose() const { return without_pose_; }

 private:
  /// After poses of so many later scans, missing labels count as lost (they are sent best effort).
  static constexpr std::size_t max_label_delay_scans = 10;
  /// Bound of the queue while the server sends nothing.
  static constexpr std::size_t max_waiting = 200;

  [[nodiscard]] std::optional<LiveScan> take_if(bool all_arrived);

  std::deque<Scan> waiting_;
  std::map<std::int64_t, Eigen::Isometry3d> T_map_lidar_;
  std::map<std::int64_t, std::vector<SemanticClass>> classes_;
  std::size_t without_pose_ = 0;
};

/// Tells which points of a scan the server has labelled: those that its ranges leave, which, unless
/// its file says them, are those of the lidar that it has recognised in the scans.
class ServersPoints {
 public:
  /// `config` is the server's, as far as it is known.
  explicit ServersPoints(const ServerConfig& config);

  /// The ranges of which the scan has as many usable points as there are labels; nothing where none
  /// that the scans so far show does.
  [[nodiscard]] std::optional<PrepareConfig> ranges_for(const Scan& scan, std::size_t labels);

 private:
  ServerConfig config_;
  SensorRecognition recognition_;
  /// The one that fitted last comes first.
  std::vector<PrepareConfig> known_;
};

struct LiveExportOptions {
  /// ROS 2 name of the sensor's topic.
  std::string topic;
  /// End after as many scans.
  std::size_t scans = SIZE_MAX;
  /// End when no scan has followed the last one for so long. The first scan may take longer.
  std::chrono::milliseconds idle_timeout{10'000};
};

/// Writes the input and output of a running server as a SemanticKITTI sequence: the sensor's scans,
/// the server's poses and, as a first guess, its labels. `config` is the server's: which points it
/// keeps (see ServersPoints), how it reads the sensor's fields. Ends with the signal, enough scans,
/// or the idle timeout. `scan_done(scans so far)`. Throws DatasetError.
[[nodiscard]] ExportSummary export_live(Client& client, const LiveExportOptions& options,
                                        const ServerConfig& config,
                                        const std::filesystem::path& folder, StopSignal& stop,
                                        const std::function<void(std::size_t)>& scan_done);

}  // namespace stillmap::cli
