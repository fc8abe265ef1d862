#include "core/traversability/path_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <sstream>
#include <utility>

namespace stillmap {
namespace {

/// Largest number of cells under the footprint, summed over all steps: of a car some 20 km with
/// cells of 0.2 m, 350 m with cells of 0.05 m.
constexpr double max_path_cells = 5e7;

/// Signed angle from one heading to another, in [-pi, pi].
double angle_between(double from_rad, double to_rad) {
  return std::remainder(to_rad - from_rad, 2.0 * std::numbers::pi);
}

PlanarPose interpolate(const PlanarPose& a, const PlanarPose& b, double share) {
  return {(1.0 - share) * a.position_map + share * b.position_map,
          a.heading_rad + share * angle_between(a.heading_rad, b.heading_rad)};
}

std::string fault_of(const TraversabilityView& view, const PlanarPose& pose, std::size_t index) {
  std::ostringstream text;
  constexpr double max_heading_rad = 1e6;
  if (!(std::abs(pose.heading_rad) <= max_heading_rad)) {
    text << "pose " << index << " has heading " << pose.heading_rad << " rad; must be within "
         << max_heading_rad << " of 0";
  } else if (!view.cell_of(pose.position_map)) {
    text << "pose " << index << " is at (" << pose.position_map.x() << ", " << pose.position_map.y()
         << "); must be finite and within 100 km of the map's origin";
  }
  return text.str();
}

PathCheck refused(TraversabilityStatus status, const std::string& reason) {
  PathCheck check;
  check.status = status;
  check.reason = reason;
  return check;
}

/// Number of steps between two poses in which no part of the robot moves more than half a cell.
int steps_between(const TraversabilityView& view, const PlanarPose& a, const PlanarPose& b) {
  const double moved_m =
      (b.position_map - a.position_map).norm() +
      std::abs(angle_between(a.heading_rad, b.heading_rad)) * view.profile.circumscribed_radius_m();
  return std::max(1, static_cast<int>(std::ceil(moved_m / (0.5 * view.cell_m))));
}

/// Cells under the footprint, summed over all steps.
double cells_to_check(const TraversabilityView& view, std::span<const PlanarPose> path_map) {
  double steps = 1.0;
  for (std::size_t i = 0; i + 1 < path_map.size(); ++i) {
    steps += steps_between(view, path_map[i], path_map[i + 1]);
  }
  return steps * (view.profile.length_m / view.cell_m + 1.0) *
         (view.profile.width_m / view.cell_m + 1.0);
}

/// Of paths that cannot be checked, however long they may be.
std::optional<PathCheck> refusal(const TraversabilityView& view,
                                 std::span<const PlanarPose> path_map) {
  if (path_map.empty())
    return refused(TraversabilityStatus::invalid_request, "the path has no poses");
  if (view.tiles.empty())
    return refused(TraversabilityStatus::not_found, TraversabilityView::nothing_known);
  for (std::size_t i = 0; i < path_map.size(); ++i) {
    const std::string fault = fault_of(view, path_map[i], i);
    if (!fault.empty()) return refused(TraversabilityStatus::invalid_request, fault);
  }
  return std::nullopt;
}

/// Checks pose after pose of a path and accumulates the result.
class PathWalk {
 public:
  explicit PathWalk(const TraversabilityView& view) : view_(view), lookup_(view) {
    check_.map_version = view.version;
    check_.clearance_m = clearance_limit_m(view.profile);
  }

  /// Checks a pose `moved_m` after the last one; false in a conflict.
  bool step_to(const PlanarPose& pose, double moved_m, std::size_t segment) {
    check_.checked_m += moved_m;
    bool is_inferred = false;
    std::optional<PathConflict> conflict;
    visit_footprint(view_, pose, [&](CellIndex index) {
      const auto [cell, surface] = lookup_.at(index);
      // Off the map there is nothing to be near to.
      if (surface != nullptr)
        check_.clearance_m = std::min(check_.clearance_m, static_cast<double>(cell.clearance_m));
      is_inferred = is_inferred || cell.inferred;
      const BlockReason reason = conflict_with(cell, view_.profile);
      if (reason == BlockReason::none || is_more_specific(conflict, reason)) return;
      conflict = {segment, check_.checked_m, pose, view_.centre_of(index), reason};
    });
    if (is_inferred) check_.inferred_m += moved_m;
    check_.conflict = conflict;
    return !conflict;
  }

  [[nodiscard]] PathCheck result() {
    check_.is_free = !check_.conflict;
    return check_;
  }

 private:
  /// A known obstacle takes precedence over unknown ground.
  static bool is_more_specific(const std::optional<PathConflict>& conflict, BlockReason reason) {
    return conflict && (conflict->reason != BlockReason::unknown || reason == BlockReason::unknown);
  }

  const TraversabilityView& view_;
  CellLookup lookup_;
  PathCheck check_;
};

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

/// Heading from position `i` to the next; nothing if they are equal.
std::optional<double> heading_of_segment(const std::vector<Eigen::Vector2d>& positions_map,
                                         std::size_t i) {
  const Eigen::Vector2d segment = positions_map[i + 1] - positions_map[i];
  if (segment.squaredNorm() == 0.0) return std::nullopt;
  return std::atan2(segment.y(), segment.x());
}

double first_heading(const std::vector<Eigen::Vector2d>& positions_map) {
  for (std::size_t i = 0; i + 1 < positions_map.size(); ++i) {
    if (const auto heading_rad = heading_of_segment(positions_map, i)) return *heading_rad;
  }
  return 0.0;
}

/// The poses at both ends of each segment, heading along it.
std::vector<PlanarPose> along_segments(const std::vector<Eigen::Vector2d>& positions_map) {
  std::vector<PlanarPose> poses;
  poses.reserve(2 * positions_map.size());
  double heading_rad = first_heading(positions_map);
  for (std::size_t i = 0; i + 1 < positions_map.size(); ++i) {
    heading_rad = heading_of_segment(positions_map, i).value_or(heading_rad);
    poses.push_back({positions_map[i], heading_rad});
    poses.push_back({positions_map[i + 1], heading_rad});
  }
  return poses;
}

/// Boxes along a path are no larger, since one box round a long path that bends holds far more
/// tiles than the path meets.
constexpr double path_box_m = 40.0;
/// What is beyond them, a path too long to be checked, shares the last one.
constexpr std::size_t max_path_boxes = 10'000;

/// Boxes that hold the polyline.
class PathBoxes {
 public:
  void line_to(const Eigen::Vector2d& position) {
    const Eigen::Vector2d from = boxes_.empty() ? position : last_;
    const double length_m = (position - from).norm();
    const double room = static_cast<double>(max_path_boxes - boxes_.size());
    const double parts = std::ceil(std::min(length_m / path_box_m, room));
    for (double part = 1.0; part < parts; part += 1.0) add(from + part / parts * (position - from));
    add(position);
  }

  [[nodiscard]] std::vector<Eigen::AlignedBox2d> with_margin(double margin_m) && {
    if (boxes_.empty()) boxes_.emplace_back(Eigen::Vector2d(0.0, 0.0));
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(margin_m);
    for (Eigen::AlignedBox2d& box : boxes_) box = {box.min() - margin, box.max() + margin};
    return std::move(boxes_);
  }

 private:
  void add(const Eigen::Vector2d& position) {
    const Eigen::AlignedBox2d here(position);
    const bool fits = !boxes_.empty() && boxes_.back().merged(here).diagonal().norm() <= path_box_m;
    if (!fits && boxes_.size() < max_path_boxes)
      boxes_.emplace_back(boxes_.empty() ? here : here.merged(Eigen::AlignedBox2d(last_)));
    else
      boxes_.back().extend(position);
    last_ = position;
  }

  std::vector<Eigen::AlignedBox2d> boxes_;
  Eigen::Vector2d last_ = Eigen::Vector2d::Zero();
};

}  // namespace

PathCheck check_long_path(const TraversabilityView& view, std::span<const PlanarPose> path_map) {
  if (const auto refusal_of_path = refusal(view, path_map)) return *refusal_of_path;
  PathWalk walk(view);
  if (!walk.step_to(path_map.front(), 0.0, 0)) return walk.result();
  for (std::size_t i = 0; i + 1 < path_map.size(); ++i) {
    const PlanarPose& a = path_map[i];
    const PlanarPose& b = path_map[i + 1];
    const int steps = steps_between(view, a, b);
    const double moved_m = (b.position_map - a.position_map).norm() / steps;
    for (int step = 1; step <= steps; ++step) {
      const PlanarPose pose = interpolate(a, b, static_cast<double>(step) / steps);
      if (!walk.step_to(pose, moved_m, i)) return walk.result();
    }
  }
  return walk.result();
}

PathCheck check_path(const TraversabilityView& view, std::span<const PlanarPose> path_map) {
  if (path_map.size() > max_path_poses) {
    return refused(TraversabilityStatus::too_large,
                   "the path has " + std::to_string(path_map.size()) + " poses; at most " +
                       std::to_string(max_path_poses) + " are checked at once");
  }
  if (const auto refusal_of_path = refusal(view, path_map)) return *refusal_of_path;
  if (cells_to_check(view, path_map) > max_path_cells) {
    return refused(TraversabilityStatus::too_large,
                   "the path is too long or turns too much to be checked at once; ask for parts");
  }
  return check_long_path(view, path_map);
}

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
  PathCheck check = check_path(view, along_segments(query.positions_map));
  // Every second of the checked segments is a turn on the spot, at the position after it.
  if (check.conflict) check.conflict->segment = (check.conflict->segment + 1) / 2;
  return check;
}

std::vector<Eigen::AlignedBox2d> boxes_along(std::span<const Eigen::Vector2d> positions_map,
                                             double reach_m) {
  PathBoxes boxes;
  for (const Eigen::Vector2d& position : positions_map) {
    if (position.allFinite()) boxes.line_to(position);
  }
  return std::move(boxes).with_margin(reach_m);
}

}  // namespace stillmap
