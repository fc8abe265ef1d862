#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <vector>

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

}  // namespace stillmap::cli
