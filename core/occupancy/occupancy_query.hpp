#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/map/throttle_callback.hpp"

namespace octomap {
class OcTree;
}

namespace stillmap {

/// State of a voxel.
enum class Occupancy : std::uint8_t { unknown = 0, free = 1, occupied = 2 };

[[nodiscard]] constexpr const char* name(Occupancy occupancy) {
  if (occupancy == Occupancy::unknown) return "unknown";
  return occupancy == Occupancy::free ? "free" : "occupied";
}

struct PointOccupancy {
  Occupancy occupancy = Occupancy::unknown;
  /// Probability of being occupied, 0..1; 0.5 where unknown.
  float probability = 0.5F;
  /// Why the query is invalid; empty when it is valid.
  std::string fault;
};

/// Counts of the voxels that a box touches.
struct BoxOccupancy {
  std::uint64_t occupied = 0;
  std::uint64_t free = 0;
  std::uint64_t unknown = 0;
  /// Centres of occupied voxels, map frame [m], up to the requested number.
  std::vector<Eigen::Vector3f> occupied_map;
  std::string fault;
};

/// A ray to cast.
struct RayQuery {
  Eigen::Vector3d origin_map = Eigen::Vector3d::Zero();
  /// Of any length but 0.
  Eigen::Vector3d direction_map = Eigen::Vector3d::UnitX();
  double max_range_m = 100.0;
  /// Unknown voxels do not end the ray (as in OctoMap's castRay).
  bool ignore_unknown = false;

  /// Largest `max_range_m`.
  static constexpr double max_length_m = 1000.0;
};

/// Result of a ray: it ended at its full range or the map's edge (free), at an occupied voxel, or
/// at an unknown one.
struct RayOccupancy {
  Occupancy end = Occupancy::unknown;
  /// Point at which the ray enters that voxel, or its end; map frame [m].
  Eigen::Vector3d end_map = Eigen::Vector3d::Zero();
  double length_m = 0.0;
  std::string fault;
};

/// Queries of one request.
struct OccupancyQuery {
  std::vector<Eigen::Vector3d> points_map;
  std::vector<Eigen::AlignedBox3d> boxes_map;
  std::vector<RayQuery> rays;
  /// Largest number of occupied voxels listed, all boxes together.
  std::uint32_t max_voxels = 1000;

  static constexpr std::size_t max_points = 10'000;
  static constexpr std::size_t max_boxes = 100;
  static constexpr std::size_t max_rays = 1000;
  static constexpr std::uint32_t max_listed_voxels = 100'000;
  /// Nodes of the octree that all boxes together may have: half a second's work to a second's.
  static constexpr std::size_t max_box_nodes = 10'000'000;

  /// One line for each limit that the request exceeds; empty when it can be answered.
  [[nodiscard]] std::string faults() const;
};

/// In the order of the queries.
struct OccupancyAnswers {
  double resolution_m = 0.0;
  std::vector<PointOccupancy> points;
  std::vector<BoxOccupancy> boxes;
  std::vector<RayOccupancy> rays;
};

// Positions are in the map frame [m]. A query that is not finite or outside the octree returns a
// fault.

[[nodiscard]] PointOccupancy query_point(const octomap::OcTree& octree,
                                         const Eigen::Vector3d& p_map);

/// At most `max_voxels` occupied voxels are listed; all are counted. Takes the octree's nodes that
/// it looks at from `nodes_left`, and returns a fault where they are not enough. `pause` is called
/// about every millisecond: meanwhile the octree may be changed, and what is not counted yet is
/// counted as it then is.
[[nodiscard]] BoxOccupancy query_box(const octomap::OcTree& octree,
                                     const Eigen::AlignedBox3d& box_map, std::size_t max_voxels,
                                     std::size_t& nodes_left, const ThrottleCallback& pause = {});

/// `pause` as of query_box.
[[nodiscard]] RayOccupancy cast_ray(const octomap::OcTree& octree, const RayQuery& ray,
                                    const ThrottleCallback& pause = {});

}  // namespace stillmap
