#include "core/occupancy/occupancy_query.hpp"

#include <octomap/OcTree.h>

#include <algorithm>
#include <sstream>

#include "core/occupancy/octree_grid.hpp"
#include "core/occupancy/octree_parts.hpp"

namespace stillmap {
namespace {

std::string too_many(const char* what, std::size_t asked, std::size_t most) {
  if (asked <= most) return {};
  std::string text = std::to_string(asked);
  text.append(" ").append(what).append(" are more than the ").append(std::to_string(most));
  return text.append(" of one request; ask several times\n");
}

using octomap::OcTree;
using octomap::OcTreeNode;

Eigen::Vector3d in_voxels(const OcTree& octree, const Eigen::Vector3d& p_map) {
  return (p_map / octree.getResolution()).array() + octree_origin;
}

std::string text_of(const Eigen::Vector3d& value) {
  std::ostringstream text;
  text << value.x() << ", " << value.y() << ", " << value.z();
  return text.str();
}

/// Why a position is not in the octree; empty when it is.
std::string position_fault(const OcTree& octree, const std::string& what,
                           const Eigen::Vector3d& p_map) {
  if (in_octree(in_voxels(octree, p_map))) return {};
  std::ostringstream text;
  text << what << " is " << text_of(p_map) << "; the occupancy map reaches from -"
       << octree_origin * octree.getResolution() << " to " << octree_origin * octree.getResolution()
       << " m";
  return text.str();
}

Occupancy occupancy_of(const OcTree& octree, const OcTreeNode* node) {
  if (node == nullptr) return Occupancy::unknown;
  return octree.isNodeOccupied(node) ? Occupancy::occupied : Occupancy::free;
}

octomap::OcTreeKey tree_key(const VoxelKey& voxel) {
  return {static_cast<octomap::key_type>(voxel.x()), static_cast<octomap::key_type>(voxel.y()),
          static_cast<octomap::key_type>(voxel.z())};
}

/// Counts the octree's voxels in a box, both ends included.
class BoxCount {
 public:
  BoxCount(const OcTree& octree, const VoxelKey& first, const VoxelKey& last,
           std::size_t max_voxels, std::size_t& nodes_left, BoxOccupancy& result)
      : octree_(octree),
        first_(first),
        last_(last),
        max_voxels_(max_voxels),
        nodes_left_(nodes_left),
        result_(result) {}

  /// Whether all of it was counted.
  [[nodiscard]] bool is_whole() const { return is_whole_; }

  /// Nodes that were looked at above those that are counted.
  void count_above(std::size_t nodes) {
    if (nodes > nodes_left_) is_whole_ = false;
    nodes_left_ -= std::min(nodes, nodes_left_);
  }

  /// `corner` is the lowest voxel of the node, `side` its voxels along an edge.
  void count(const OcTreeNode& node, const VoxelKey& corner, std::int32_t side) {
    const VoxelKey from = corner.cwiseMax(first_);
    const VoxelKey to = (corner.array() + (side - 1)).matrix().cwiseMin(last_);
    if ((from.array() > to.array()).any()) return;
    if (nodes_left_ == 0) is_whole_ = false;
    if (!is_whole_) return;
    --nodes_left_;
    if (!octree_.nodeHasChildren(&node)) {
      count_leaf(node, from, to);
      return;
    }
    const std::int32_t half = side / 2;
    for (unsigned i = 0; i < 8; ++i) {
      if (!octree_.nodeChildExists(&node, i)) continue;
      const VoxelKey part((i & 1U) != 0 ? half : 0, (i & 2U) != 0 ? half : 0,
                          (i & 4U) != 0 ? half : 0);
      count(*octree_.getNodeChild(&node, i), corner + part, half);
    }
  }

 private:
  void count_leaf(const OcTreeNode& leaf, const VoxelKey& from, const VoxelKey& to) {
    const auto voxels = static_cast<std::uint64_t>(
        (to - from).array().cast<std::int64_t>().operator+(std::int64_t{1}).prod());
    if (!octree_.isNodeOccupied(&leaf)) {
      result_.free += voxels;
      return;
    }
    result_.occupied += voxels;
    for (VoxelKey v = from; v.x() <= to.x(); ++v.x()) {
      for (v.y() = from.y(); v.y() <= to.y(); ++v.y()) {
        for (v.z() = from.z(); v.z() <= to.z(); ++v.z()) {
          if (result_.occupied_map.size() >= max_voxels_) return;
          result_.occupied_map.push_back(centre_map(v));
        }
      }
    }
  }

  [[nodiscard]] Eigen::Vector3f centre_map(const VoxelKey& voxel) const {
    const Eigen::Array3d centre = voxel.cast<double>().array() - octree_origin + 0.5;
    return (centre * octree_.getResolution()).matrix().cast<float>();
  }

  const OcTree& octree_;
  VoxelKey first_;
  VoxelKey last_;
  std::size_t max_voxels_;
  std::size_t& nodes_left_;
  BoxOccupancy& result_;
  bool is_whole_ = true;
};

std::string box_fault(const OcTree& octree, const Eigen::AlignedBox3d& box_map) {
  std::string fault = position_fault(octree, "box's minimum", box_map.min());
  if (fault.empty()) fault = position_fault(octree, "box's maximum", box_map.max());
  if (!fault.empty() || (box_map.min().array() <= box_map.max().array()).all()) return fault;
  return "box's minimum " + text_of(box_map.min()) + " is above its maximum " +
         text_of(box_map.max());
}

std::string ray_fault(const OcTree& octree, const RayQuery& ray) {
  if (std::string fault = position_fault(octree, "ray's origin", ray.origin_map); !fault.empty()) {
    return fault;
  }
  const double length = ray.direction_map.stableNorm();
  if (!std::isfinite(length) || length < 1e-9) {
    return "ray's direction is " + text_of(ray.direction_map) +
           "; it must be finite and longer than 0";
  }
  if (ray.max_range_m > 0.0 && ray.max_range_m <= RayQuery::max_length_m) return {};
  std::ostringstream text;
  text << "ray's max_range_m is " << ray.max_range_m << "; it must be above 0 and at most "
       << RayQuery::max_length_m;
  return text.str();
}

}  // namespace

std::string OccupancyQuery::faults() const {
  return too_many("points", points_map.size(), max_points) +
         too_many("boxes", boxes_map.size(), max_boxes) + too_many("rays", rays.size(), max_rays) +
         too_many("voxels (max_voxels)", max_voxels, max_listed_voxels);
}

PointOccupancy query_point(const OcTree& octree, const Eigen::Vector3d& p_map) {
  PointOccupancy result;
  result.fault = position_fault(octree, "point", p_map);
  if (!result.fault.empty()) return result;
  const VoxelKey voxel = in_voxels(octree, p_map).array().floor().cast<std::int32_t>();
  const OcTreeNode* const node = octree.search(tree_key(voxel));
  result.occupancy = occupancy_of(octree, node);
  if (node != nullptr) result.probability = static_cast<float>(node->getOccupancy());
  return result;
}

BoxOccupancy query_box(const OcTree& octree, const Eigen::AlignedBox3d& box_map,
                       std::size_t max_voxels, std::size_t& nodes_left,
                       const ThrottleCallback& pause) {
  BoxOccupancy result;
  result.fault = box_fault(octree, box_map);
  if (!result.fault.empty()) return result;
  const VoxelKey first = in_voxels(octree, box_map.min()).array().floor().cast<std::int32_t>();
  const VoxelKey last = in_voxels(octree, box_map.max()).array().floor().cast<std::int32_t>();
  if (pause) pause();
  const OctreeParts found = parts_of(octree, first, last);
  BoxCount count(octree, first, last, max_voxels, nodes_left, result);
  count.count_above(found.nodes_above);
  for (const OctreePart& part : found.parts) {
    if (!count.is_whole()) break;
    if (pause) pause();
    const OcTreeNode* const node = node_of(octree, part);
    if (node != nullptr) count.count(*node, part.corner, part.side);
  }
  if (!count.is_whole()) {
    BoxOccupancy refused;
    refused.fault =
        "the boxes up to this one have more than " + std::to_string(OccupancyQuery::max_box_nodes) +
        " nodes of the occupancy map; ask for fewer or smaller ones, in several requests";
    return refused;
  }
  const auto all = static_cast<std::uint64_t>(
      ((last - first).cast<std::int64_t>().array() + std::int64_t{1}).prod());
  result.unknown = all - result.occupied - result.free;
  return result;
}

RayOccupancy cast_ray(const OcTree& octree, const RayQuery& query, const ThrottleCallback& pause) {
  constexpr std::uint32_t steps_between_pauses = 1024;
  RayOccupancy result;
  result.fault = ray_fault(octree, query);
  if (!result.fault.empty()) return result;
  const double resolution_m = octree.getResolution();
  const double length = query.max_range_m / resolution_m;
  const Eigen::Vector3d direction = query.direction_map.stableNormalized();
  RayIterator ray(in_voxels(octree, query.origin_map), direction);
  const auto inside = [&] {
    return (ray.voxel().array() >= 0).all() && (ray.voxel().array() < octree_side).all();
  };
  result.end = Occupancy::free;
  result.length_m = query.max_range_m;
  for (std::uint32_t steps = 0; ray.entered_at() < length; ray.step()) {
    if (++steps % steps_between_pauses == 0 && pause) pause();
    const Occupancy here =
        inside() ? occupancy_of(octree, octree.search(tree_key(ray.voxel()))) : Occupancy::unknown;
    const bool continues =
        here == Occupancy::free || (here == Occupancy::unknown && query.ignore_unknown && inside());
    if (continues) continue;
    // An unknown voxel that ends the ray despite ignore_unknown lies beyond the map's edge.
    result.end = here == Occupancy::unknown && query.ignore_unknown ? Occupancy::free : here;
    result.length_m = ray.entered_at() * resolution_m;
    break;
  }
  result.end_map = query.origin_map + result.length_m * direction;
  return result;
}

}  // namespace stillmap
