#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace stillmap {

/// Where the submaps of a map lie, and the loops that join them. What somebody keeps beside a map
/// moves along with it when its place is kept relative to the nearest submap.
struct SubmapList {
  /// How often the submaps were moved against one another since the map began.
  std::uint64_t graph_revision = 0;

  /// In the order of the drive; a submap keeps its number.
  struct Entry {
    /// Of the scan whose pose stands for the submap.
    std::int64_t stamp_ns = 0;
    /// Way of the lidar from the drive's start until then [m].
    double way_m = 0.0;
    /// Pose of the lidar; of another frame of the robot after `of_frame`.
    Eigen::Isometry3d T_map_submap = Eigen::Isometry3d::Identity();
  };
  std::vector<Entry> submaps;

  /// A place that was seen again.
  struct Loop {
    /// Numbers of submaps; `from` < `to`.
    std::size_t from = 0;
    std::size_t to = 0;
    /// As measured: the graph's poses agree with it as far as its other edges allow.
    Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
    /// Share of one submap that lies where the other has points, and how well what stands up fits
    /// (1: perfectly).
    double overlap = 0.0;
    double upright_fit = 0.0;
    /// By how much the later place moved against what was known until then [m].
    double jump_m = 0.0;
  };
  std::vector<Loop> loops;
};

/// The same with poses of a frame that is fixed to the lidar.
[[nodiscard]] inline SubmapList of_frame(SubmapList list, const Eigen::Isometry3d& T_lidar_frame) {
  for (SubmapList::Entry& entry : list.submaps)
    entry.T_map_submap = entry.T_map_submap * T_lidar_frame;
  for (SubmapList::Loop& loop : list.loops)
    loop.T_from_to = T_lidar_frame.inverse() * loop.T_from_to * T_lidar_frame;
  return list;
}

}  // namespace stillmap
