#include "core/dataset/scan_remarks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/scan_dataset.hpp"
#include "core/lidar/level_plane.hpp"
#include "core/lidar/measured_elevation.hpp"

namespace stillmap {
namespace {

constexpr std::size_t min_points = 500;

/// The measured points, thinned to some thousand.
std::vector<Eigen::Vector3f> some_of(std::span<const Eigen::Vector3f> points) {
  constexpr std::size_t enough = 4000;
  std::vector<Eigen::Vector3f> some;
  const std::size_t step = points.size() / enough + 1;
  for (std::size_t i = 0; i < points.size(); i += step)
    if (is_measured(points[i])) some.push_back(points[i]);
  return some;
}

/// Ground as it would be if the third coordinate pointed up.
struct Below {
  double share_on_plane = 0.0;
  double share_beyond = 0.0;
  double height_m = 0.0;
  /// Points lie on it on all four sides of the lidar's foot.
  bool is_around = false;
};

Below below(const std::vector<Eigen::Vector3f>& points) {
  constexpr float min_depth_m = 0.3F, reach_m = 40.0F;
  constexpr double max_slope = 0.25, min_share_below = 0.3, on_plane_m = 0.2, beyond_m = 0.6;
  std::vector<Eigen::Vector3f> low;
  for (const Eigen::Vector3f& p : points)
    if (p.z() < -min_depth_m && p.norm() < reach_m) low.push_back(p);
  const auto plane = fit_level_plane(low, max_slope, min_share_below);
  if (!plane) return {};
  Below found{.height_m = -plane->height_m};
  std::array<std::size_t, 4> sides{};
  std::size_t on_plane = 0, beyond = 0;
  for (const Eigen::Vector3f& p : low) {
    const double above = p.z() - plane->at(p.head<2>().cast<double>());
    beyond += above < -beyond_m ? 1 : 0;
    if (std::abs(above) > on_plane_m) continue;
    ++on_plane;
    ++sides[(p.x() > 0.0F ? 2U : 0U) + (p.y() > 0.0F ? 1U : 0U)];
  }
  const auto all = static_cast<double>(points.size());
  found.share_on_plane = static_cast<double>(on_plane) / all;
  found.share_beyond = static_cast<double>(beyond) / all;
  found.is_around = std::ranges::all_of(sides, [&](std::size_t n) { return 12 * n > on_plane; });
  return found;
}

bool is_ground(const Below& side) {
  constexpr double min_share = 0.25, max_share_beyond = 0.02, max_height_m = 4.0;
  return side.share_on_plane > min_share && side.share_beyond < max_share_beyond &&
         side.height_m < max_height_m && side.is_around;
}

constexpr std::size_t sectors = 36;

/// Directions round the lidar in which the scan has points.
std::array<bool, sectors> seen_sectors(const Scan& scan) {
  constexpr std::size_t min_points_in_sector = 5;
  std::array<std::size_t, sectors> points{};
  for (const Eigen::Vector3f& p : scan.points_lidar) {
    if (!is_measured(p)) continue;
    const double turn = 0.5 + std::atan2(double{p.y()}, double{p.x()}) / (2.0 * std::numbers::pi);
    ++points[std::min(static_cast<std::size_t>(turn * sectors), sectors - 1)];
  }
  std::array<bool, sectors> seen{};
  std::ranges::transform(points, seen.begin(),
                         [](std::size_t n) { return n >= min_points_in_sector; });
  return seen;
}

/// Three pairs of scans that follow each other, from all over the recording.
std::vector<std::pair<Scan, Scan>> pairs_of(const ScanDataset& dataset) {
  constexpr std::size_t wanted = 3;
  std::vector<std::pair<Scan, Scan>> pairs;
  for (std::size_t k = 1; k <= wanted; ++k) {
    const std::size_t i = k * dataset.size() / (wanted + 1);
    if (i + 1 >= dataset.size()) continue;
    try {
      pairs.emplace_back(dataset.read_uncorrected(i).scan, dataset.read_uncorrected(i + 1).scan);
    } catch (const DatasetError&) {
      // Whoever reads that scan is told.
      continue;
    }
  }
  return pairs;
}

/// The names of coordinates that put this axis up.
std::string fields_for(const std::string& up) {
  if (up == "-z") return "{y: [-y], z: [-z]}";
  if (up == "y") return "{x: [z], y: [-x], z: [y]} as Unity's, {y: [-z], z: [y]} right-handed ones";
  return "{z: [" + up + "]} with x and y that suit it";
}

}  // namespace

std::optional<std::string> other_up_axis(std::span<const Eigen::Vector3f> points) {
  constexpr double some_ground = 0.08;
  const std::vector<Eigen::Vector3f> some = some_of(points);
  if (some.size() < min_points || below(some).share_on_plane > some_ground) return std::nullopt;
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
    if (is_ground(below(up)) && below(down).share_on_plane < some_ground) return axis.name;
  }
  return std::nullopt;
}

bool are_parts_of_a_turn(const Scan& first, const Scan& second) {
  const auto seen_first = seen_sectors(first), seen_second = seen_sectors(second);
  std::size_t in_first = 0, in_second = 0, in_both = 0;
  for (std::size_t k = 0; k < sectors; ++k) {
    in_first += seen_first[k] ? 1 : 0;
    in_second += seen_second[k] ? 1 : 0;
    in_both += seen_first[k] && seen_second[k] ? 1 : 0;
  }
  // Where both are narrow, one may be covered, or look another way.
  constexpr std::size_t min_seen = sectors / 9;
  const std::size_t less = std::min(in_first, in_second);
  return less >= min_seen && 4 * in_both <= less;
}

std::vector<std::string> remarks_on_scans(const ScanDataset& dataset) {
  std::vector<std::string> remarks;
  const std::vector<std::pair<Scan, Scan>> pairs = pairs_of(dataset);
  if (pairs.size() < 2) return remarks;
  if (std::ranges::all_of(
          pairs, [](const auto& pair) { return are_parts_of_a_turn(pair.first, pair.second); }))
    remarks.push_back(
        "scans that follow each other look into other directions, as parts of one turn: of half "
        "turns every second scan is lost, and poses may be metres off; let the lidar turn once a "
        "scan (CARLA: rotation_frequency = 1 / fixed_delta_seconds), or join the parts");
  std::optional<std::string> up = other_up_axis(pairs.front().first.points_lidar);
  for (const auto& [scan, next] : pairs)
    if (up != other_up_axis(scan.points_lidar)) up.reset();
  if (up)
    remarks.push_back("by the ground that these points show, " + *up +
                      " is up, while x is taken for ahead, y for left and z for up; 'input: "
                      "{fields: ...}' in a --config file puts other axes right (" +
                      fields_for(*up) + "), --mount says how a lidar hangs");
  return remarks;
}

}  // namespace stillmap
