#pragma once

#include <tsl/robin_map.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap {

struct SubmapConfig {
  /// Way of the lidar along one submap [m].
  double length_m = 25.0;
  double voxel_size_m = 0.25;
  /// Points farther from the lidar than this are left out [m].
  double max_range_m = 40.0;
  /// A voxel counts once so many scans, each a step from the last, have hit it: what moves without
  /// a label leaves few hits at one place.
  int min_scans = 2;
  double scan_spacing_m = 0.2;
};

/// What stood still along a stretch of a drive. Its frame is that of one of its poses, the key,
/// turned upright: origin at the key's lidar, z along z of the odometry's frame, x ahead of the
/// key.
struct Submap {
  /// Number of the graph's node that is the key.
  std::size_t key_node = 0;
  /// Way of the lidar from the drive's start to the key [m].
  double way_m = 0.0;
  Eigen::Isometry3d T_submap_key = Eigen::Isometry3d::Identity();
  /// Mean of each voxel's points, and the class of its first.
  std::vector<Eigen::Vector3f> points_submap;
  std::vector<SemanticClass> classes;

  [[nodiscard]] std::size_t bytes() const {
    return sizeof(*this) + points_submap.capacity() * sizeof(Eigen::Vector3f) + classes.capacity();
  }
};

/// The motion that turns the key's frame upright.
[[nodiscard]] Eigen::Isometry3d upright_from_key(const Eigen::Isometry3d& T_odom_key);

/// Gathers the stationary points of scans.
class SubmapBuilder {
 public:
  explicit SubmapBuilder(const SubmapConfig& config) : config_(config) {}

  void add(const LabelledScan& scan, const Eigen::Isometry3d& T_odom_lidar);
  /// What was gathered, in the upright frame of this pose; begins anew.
  [[nodiscard]] Submap take(const Eigen::Isometry3d& T_odom_key);
  [[nodiscard]] bool empty() const { return voxels_.empty(); }

 private:
  struct Voxel {
    /// Of the points, from the origin.
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    float points = 0.0F;
    std::uint32_t last_scan = 0;
    std::uint16_t scans = 0;
    SemanticClass label = SemanticClass::unlabeled;
  };
  void add(const Eigen::Vector3f& point_origin, SemanticClass label);

  SubmapConfig config_;
  /// Place of the first scan: near it, single precision is enough.
  Eigen::Vector3d origin_odom_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d last_odom_ = Eigen::Vector3d::Zero();
  std::uint32_t scans_ = 0;
  tsl::robin_map<std::uint64_t, Voxel> voxels_;
};

}  // namespace stillmap
