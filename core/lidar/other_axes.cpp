#include "core/lidar/other_axes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "core/lidar/level_plane.hpp"
#include "core/lidar/measured_elevation.hpp"

namespace stillmap {
namespace {

constexpr std::size_t min_points_for_ground = 500;

/// The measured points, thinned to some thousand.
std::vector<Eigen::Vector3f> some_of(std::span<const Eigen::Vector3f> points) {
  constexpr std::size_t enough = 4000;
  std::vector<Eigen::Vector3f> some;
  const std::size_t step = points.size() / enough + 1;
  for (std::size_t i = 0; i < points.size(); i += step)
    if (is_measured(points[i])) some.push_back(points[i]);
  return some;
}

/// A level plane on the side of the lidar that the third coordinate points away from.
struct Below {
  double share_on_plane = 0.0;
  double share_beyond = 0.0;
  /// Of the points on the plane, those as far off as few rooms are wide.
  double share_far = 0.0;
  double height_m = 0.0;
  /// Points lie on it on all four sides of the lidar's foot.
  bool is_around = false;
};

/// Of the points deeper than `min_depth_m`.
Below level_below(const std::vector<Eigen::Vector3f>& points, float min_depth_m) {
  constexpr float reach_m = 40.0F, far_m = 10.0F;
  constexpr double max_slope = 0.25, min_share_below = 0.3, on_plane_m = 0.2, beyond_m = 0.6;
  std::vector<Eigen::Vector3f> low;
  for (const Eigen::Vector3f& p : points)
    if (p.z() < -min_depth_m && p.norm() < reach_m) low.push_back(p);
  const auto plane = fit_level_plane(low, max_slope, min_share_below);
  if (!plane) return {};
  Below found{.height_m = -plane->height_m};
  std::array<std::size_t, 4> sides{};
  std::size_t on_plane = 0, beyond = 0, far = 0;
  for (const Eigen::Vector3f& p : low) {
    const double above = p.z() - plane->at(p.head<2>().cast<double>());
    beyond += above < -beyond_m ? 1 : 0;
    if (std::abs(above) > on_plane_m) continue;
    ++on_plane;
    far += p.norm() > far_m ? 1 : 0;
    ++sides[(p.x() > 0.0F ? 2U : 0U) + (p.y() > 0.0F ? 1U : 0U)];
  }
  const auto all = static_cast<double>(points.size());
  found.share_on_plane = static_cast<double>(on_plane) / all;
  found.share_beyond = static_cast<double>(beyond) / all;
  if (on_plane > 0) found.share_far = static_cast<double>(far) / static_cast<double>(on_plane);
  found.is_around = std::ranges::all_of(sides, [&](std::size_t n) { return 12 * n > on_plane; });
  return found;
}

/// A lidar may stand so low that its ground is nearer than any that is claimed.
constexpr float any_depth_m = 0.05F;
constexpr float ground_depth_m = 0.3F;

bool is_ground(const Below& side) {
  constexpr double min_share = 0.25, max_share_beyond = 0.02, max_height_m = 4.0;
  return side.share_on_plane > min_share && side.share_beyond < max_share_beyond &&
         side.height_m < max_height_m && side.is_around;
}

constexpr std::size_t directions = 36;

/// Directions round the third axis in which so many points lie, no more than `max_elevation_deg`
/// off its level.
std::array<bool, directions> seen_sectors(std::span<const Eigen::Vector3f> points,
                                          std::size_t min_points_in_sector,
                                          double max_elevation_deg) {
  const double max_slope = std::tan(max_elevation_deg * std::numbers::pi / 180.0);
  std::array<std::size_t, directions> counts{};
  for (const Eigen::Vector3f& p : points) {
    if (!is_measured(p) || std::abs(p.z()) > max_slope * p.head<2>().norm()) continue;
    const double turn = 0.5 + std::atan2(double{p.y()}, double{p.x()}) / (2.0 * std::numbers::pi);
    ++counts[std::min(static_cast<std::size_t>(turn * directions), directions - 1)];
  }
  std::array<bool, directions> seen{};
  std::ranges::transform(counts, seen.begin(),
                         [=](std::size_t n) { return n >= min_points_in_sector; });
  return seen;
}

/// Whether the lidar looks round this axis: one that does not cannot stand upright on it, and what
/// looks like ground is a wall.
bool is_looked_round(const std::vector<Eigen::Vector3f>& points) {
  constexpr std::size_t min_points_in_sector = 3, may_lack = 3;
  constexpr double near_level_deg = 20.0;
  const auto seen = seen_sectors(points, min_points_in_sector, near_level_deg);
  return static_cast<std::size_t>(std::ranges::count(seen, true)) + may_lack >= directions;
}

/// Whether what looks like ground may be a ceiling: it reaches no farther than a room, or there is
/// a floor opposite, however little of it is seen, or nothing is looked at there. What a few beams
/// see of the world at the lidar's height is level, too, but not as deep as a floor.
bool may_be_ceiling(const std::vector<Eigen::Vector3f>& up,
                    const std::vector<Eigen::Vector3f>& down, const Below& ground) {
  constexpr double min_share_far = 0.12, some_floor = 0.06, min_share_opposite = 0.02;
  const auto above =
      std::ranges::count_if(up, [](const Eigen::Vector3f& p) { return p.z() > any_depth_m; });
  return ground.share_far < min_share_far ||
         level_below(down, ground_depth_m).share_on_plane > some_floor ||
         static_cast<double>(above) < min_share_opposite * static_cast<double>(up.size());
}

}  // namespace

std::optional<std::string> other_up_axis(std::span<const Eigen::Vector3f> points) {
  constexpr double some_ground = 0.08;
  const std::vector<Eigen::Vector3f> some = some_of(points);
  if (some.size() < min_points_for_ground ||
      level_below(some, any_depth_m).share_on_plane > some_ground)
    return std::nullopt;
  struct Axis {
    const char* name;
    std::array<int, 3> order;
    float sign;
  };
  constexpr std::array axes{Axis{"-z", {0, 1, 2}, -1.0F}, Axis{"y", {2, 0, 1}, 1.0F},
                            Axis{"-y", {2, 0, 1}, -1.0F}, Axis{"x", {1, 2, 0}, 1.0F},
                            Axis{"-x", {1, 2, 0}, -1.0F}};
  for (const Axis& axis : axes) {
    std::vector<Eigen::Vector3f> up, down;
    for (const Eigen::Vector3f& p : some) {
      up.emplace_back(p[axis.order[0]], p[axis.order[1]], axis.sign * p[axis.order[2]]);
      down.emplace_back(up.back().x(), up.back().y(), -up.back().z());
    }
    const Below ground = level_below(up, ground_depth_m), opposite = level_below(down, any_depth_m);
    if (!is_ground(ground) || opposite.share_on_plane > some_ground || !is_looked_round(up))
      continue;
    if (axis.order[2] == 2 && may_be_ceiling(up, down, ground)) continue;
    return axis.name;
  }
  return std::nullopt;
}

bool are_parts_of_a_turn(const Scan& first, const Scan& second) {
  constexpr std::size_t min_points_in_sector = 5;
  constexpr double any_elevation_deg = 89.9;
  const auto seen = [&](const Scan& scan) {
    return seen_sectors(scan.points_lidar, min_points_in_sector, any_elevation_deg);
  };
  const auto seen_first = seen(first), seen_second = seen(second);
  std::size_t in_first = 0, in_second = 0, in_both = 0;
  for (std::size_t k = 0; k < directions; ++k) {
    in_first += seen_first[k] ? 1 : 0;
    in_second += seen_second[k] ? 1 : 0;
    in_both += seen_first[k] && seen_second[k] ? 1 : 0;
  }
  // Where both are narrow, one may be covered, or look another way.
  constexpr std::size_t min_seen = directions / 9;
  const std::size_t less = std::min(in_first, in_second);
  return less >= min_seen && 4 * in_both <= less;
}

std::string fields_for_up_axis(const std::string& up) {
  if (up == "-z") return "{y: [-y], z: [-z]}";
  if (up == "y") return "{x: [z], y: [-x], z: [y]} as Unity's, {y: [-z], z: [y]} right-handed ones";
  return "{z: [" + up + "]} with x and y that suit it";
}

ScanDoubts::Look ScanDoubts::look(const Scan& first, const Scan& second) const {
  return {.up = is_mount_known_ ? std::nullopt : other_up_axis(first.points_lidar),
          .are_parts = are_parts_of_a_turn(first, second)};
}

bool ScanDoubts::add(const Scan& scan) {
  // Some seconds apart, so that a robot that drives sees other ground.
  constexpr std::size_t scans_between_looks = 50;
  constexpr std::size_t agreeing_looks = 3;
  const std::size_t phase = scans_++ % scans_between_looks;
  if (phase == 0) first_ = scan;
  if (phase != 1) return false;
  looks_.push_back(look(std::exchange(first_, {}), scan));
  if (looks_.size() > agreeing_looks) looks_.pop_front();
  if (looks_.size() < agreeing_looks) return false;
  bool has_changed = false;
  const auto agree = [&](auto member, auto& said) {
    const auto& newest = looks_.back().*member;
    const auto is_same = [&](const Look& other) { return other.*member == newest; };
    if (said == newest || !std::ranges::all_of(looks_, is_same)) return;
    said = newest;
    has_changed = true;
  };
  agree(&Look::up, said_.up);
  agree(&Look::are_parts, said_.are_parts);
  return has_changed;
}

}  // namespace stillmap
