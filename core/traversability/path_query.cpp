#include "core/traversability/path_query.hpp"

#include <cmath>
#include <sstream>

namespace stillmap {
namespace {

std::string fault_of(const PathQuery& query) {
  const std::size_t positions = query.positions_map.size();
  const std::size_t headings = query.headings_rad.size();
  std::ostringstream text;
  if (headings != 0 && headings != positions) {
    text << "the path has " << positions << " positions and " << headings
         << " headings; give one for every position, or none";
  } else if (positions == 1 && headings == 0) {
    text << "the path has one position and no heading; give a heading or a second position";
  }
  for (std::size_t i = 0; i < positions && text.view().empty(); ++i) {
    const Eigen::Vector2d& p = query.positions_map[i];
    if (p.allFinite()) continue;
    text << "position " << i << " is (" << p.x() << ", " << p.y() << "); must be finite";
  }
  return text.str();
}

std::vector<PlanarPose> with_headings(const PathQuery& query) {
  std::vector<PlanarPose> poses;
  poses.reserve(query.positions_map.size());
  for (std::size_t i = 0; i < query.positions_map.size(); ++i) {
    poses.push_back({query.positions_map[i], query.headings_rad[i]});
  }
  return poses;
}

/// Of the way from position `i` to the next; nothing for a way of no length.
std::optional<double> heading_of_way(const std::vector<Eigen::Vector2d>& positions_map,
                                     std::size_t i) {
  const Eigen::Vector2d way = positions_map[i + 1] - positions_map[i];
  if (way.squaredNorm() == 0.0) return std::nullopt;
  return std::atan2(way.y(), way.x());
}

double first_heading(const std::vector<Eigen::Vector2d>& positions_map) {
  for (std::size_t i = 0; i + 1 < positions_map.size(); ++i) {
    if (const auto heading_rad = heading_of_way(positions_map, i)) return *heading_rad;
  }
  return 0.0;
}

/// Two poses a way between positions: where it begins and where it ends, both looking along it.
std::vector<PlanarPose> straight_ahead(const std::vector<Eigen::Vector2d>& positions_map) {
  std::vector<PlanarPose> poses;
  poses.reserve(2 * positions_map.size());
  double heading_rad = first_heading(positions_map);
  for (std::size_t i = 0; i + 1 < positions_map.size(); ++i) {
    heading_rad = heading_of_way(positions_map, i).value_or(heading_rad);
    poses.push_back({positions_map[i], heading_rad});
    poses.push_back({positions_map[i + 1], heading_rad});
  }
  return poses;
}

PathCheck refused(TraversabilityStatus status, const std::string& reason) {
  PathCheck check;
  check.status = status;
  check.reason = reason;
  return check;
}

}  // namespace

PathCheck check_path(const TraversabilityView& view, const PathQuery& query) {
  const std::size_t max_positions =
      query.headings_rad.empty() ? max_path_poses / 2 : max_path_poses;
  if (query.positions_map.size() > max_positions) {
    return refused(TraversabilityStatus::too_large,
                   "the path has " + std::to_string(query.positions_map.size()) +
                       " positions; at most " + std::to_string(max_positions) +
                       " are checked at once");
  }
  if (const std::string fault = fault_of(query); !fault.empty()) {
    return refused(TraversabilityStatus::invalid_request, fault);
  }
  if (!query.headings_rad.empty()) return check_path(view, with_headings(query));
  PathCheck check = check_path(view, straight_ahead(query.positions_map));
  // Every second of its ways is a turn at the end of the one before.
  if (check.conflict) check.conflict->segment /= 2;
  return check;
}

}  // namespace stillmap
