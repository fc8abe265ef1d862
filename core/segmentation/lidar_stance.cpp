#include "core/segmentation/lidar_stance.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <limits>
#include <numbers>
#include <vector>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/level_plane.hpp"

namespace stillmap {
namespace {

constexpr float reach_m = 20.0F;
/// The robot itself.
constexpr float nearest_m = 2.0F;
/// 30 degrees.
constexpr double max_slope = 0.58;

Eigen::Vector3d normal_of(const LevelPlane& plane) {
  return Eigen::Vector3d(-plane.slope.x(), -plane.slope.y(), 1.0).normalized();
}

double above(const LevelPlane& plane, const Eigen::Vector3f& p) {
  return static_cast<double>(p.z()) - plane.at(p.head<2>().cast<double>());
}

/// Square metres, row by row.
constexpr int across = 40;

/// The square metre that a point lies on. Nothing for one on the robot, out of reach, or nowhere.
std::optional<std::size_t> cell_of(const Eigen::Vector3f& p) {
  const float squared_m2 = p.head<2>().squaredNorm();
  if (!(squared_m2 >= nearest_m * nearest_m && squared_m2 < reach_m * reach_m)) return std::nullopt;
  const Eigen::Vector2i cell = (p.head<2>().array() + reach_m).cast<int>();
  // A hair within reach the sum is rounded up to all of it.
  if (cell.minCoeff() < 0 || cell.maxCoeff() >= across) return std::nullopt;
  return static_cast<std::size_t>(cell.y() * across + cell.x());
}

/// The lowest point of each square metre: ground nearly everywhere, for it lies below whatever
/// stands on it, and as much of it far away as near by.
std::vector<Eigen::Vector3f> lowest_points(std::span<const Eigen::Vector3f> points) {
  constexpr float nothing_m = std::numeric_limits<float>::infinity();
  std::vector<Eigen::Vector3f> lowest(across * across, Eigen::Vector3f(0.0F, 0.0F, nothing_m));
  for (const Eigen::Vector3f& p : points) {
    const auto cell = cell_of(p);
    if (!cell) continue;
    Eigen::Vector3f& so_far = lowest[*cell];
    if (p.z() < so_far.z()) so_far = p;
  }
  std::erase_if(lowest, [](const Eigen::Vector3f& p) { return !p.allFinite(); });
  return lowest;
}

/// Whether the points on the plane lie far enough apart in every direction to tell its slope, and
/// are most of all; those below it, as beside a dam or a bridge, few.
bool is_ground_of(const LevelPlane& plane, std::span<const Eigen::Vector3f> lowest) {
  constexpr double on_m = 0.2, below_m = -0.3;
  constexpr double min_share = 0.5, max_share_below = 0.15, min_deviation_m = 3.0;
  std::size_t on = 0, below = 0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector3f& p : lowest) {
    const double height_m = above(plane, p);
    below += height_m < below_m ? 1 : 0;
    if (std::abs(height_m) >= on_m) continue;
    const Eigen::Vector2d at = p.head<2>().cast<double>();
    ++on;
    sum += at;
    squares += at * at.transpose();
  }
  const auto all = static_cast<double>(lowest.size()), count = static_cast<double>(on);
  if (count < min_share * all || static_cast<double>(below) > max_share_below * all) return false;
  const Eigen::Vector2d mean = sum / count;
  const Eigen::Matrix2d covariance = squares / count - mean * mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(covariance, Eigen::EigenvaluesOnly);
  return solver.eigenvalues().x() > min_deviation_m * min_deviation_m;
}

double angle_between(const LevelPlane& a, const LevelPlane& b) {
  return std::acos(std::clamp(normal_of(a).dot(normal_of(b)), -1.0, 1.0));
}

constexpr double max_angle = 2.5 * rad_per_deg;

/// Whether what lies near the plane up its slope, and what lies down it, are parts of it.
bool is_plane_in_both_halves(const LevelPlane& plane, std::span<const Eigen::Vector3f> lowest) {
  constexpr double near_m = 0.5, min_share = 0.3;
  const Eigen::Vector2f up_slope = plane.slope.normalized().cast<float>();
  std::vector<Eigen::Vector3f> sorted;
  std::ranges::copy_if(lowest, std::back_inserter(sorted), [&](const Eigen::Vector3f& p) {
    return std::abs(above(plane, p)) < near_m;
  });
  std::ranges::sort(sorted, {},
                    [&](const Eigen::Vector3f& p) { return up_slope.dot(p.head<2>()); });
  const auto middle = static_cast<std::size_t>(sorted.size() / 2);
  const std::span<const Eigen::Vector3f> all(sorted);
  return std::ranges::all_of(std::array{all.first(middle), all.subspan(middle)}, [&](auto half) {
    const auto part = fit_level_plane(half, 2.0 * max_slope, min_share);
    return part && angle_between(*part, plane) < max_angle;
  });
}

/// Whether the ground on one side of the lidar, up the plane's slope or down it, is another plane
/// that goes through its foot as well: then the place has two grades, and the lidar stands on
/// either. Where it sees no ground on a side, as behind one that looks down ahead, nothing speaks
/// against the plane.
bool has_another_grade(const LevelPlane& plane, std::span<const Eigen::Vector3f> lowest) {
  constexpr double min_share = 0.6, same_foot_m = 0.5;
  std::array<std::vector<Eigen::Vector3f>, 2> sides;
  for (const Eigen::Vector3f& p : lowest)
    sides[plane.slope.dot(p.head<2>().cast<double>()) < 0.0 ? 0 : 1].push_back(p);
  return std::ranges::any_of(sides, [&](const auto& side) {
    const auto other = fit_level_plane(side, max_slope, min_share);
    return other && angle_between(*other, plane) > max_angle &&
           std::abs(other->height_m - plane.height_m) < same_foot_m;
  });
}

/// Whether the ground beside the lidar is on the plane: a road above the fields around it is not on
/// theirs, nor a level lane in a slope on that of the slope. In each direction the nearest square
/// metre that is flat along the plane tells; a third of them may be off it, as pavements and roofs
/// of parked cars are (of real scans up to 5 of 24, a street full of cars 7, roads above fields 14
/// and more).
bool holds_beside_lidar(const LevelPlane& plane, std::span<const Eigen::Vector3f> points) {
  constexpr std::size_t directions = 24, max_off_of = 3;
  constexpr double on_m = 0.2, flat_m = 0.15, two_pi = 2.0 * std::numbers::pi;
  constexpr double far_m = std::numeric_limits<double>::infinity();
  struct Cell {
    double lowest_m = far_m, highest_m = -far_m;
  };
  std::vector<Cell> cells(across * across);
  for (const Eigen::Vector3f& p : points) {
    const auto at = cell_of(p);
    if (!at) continue;
    const double height_m = above(plane, p);
    cells[*at].lowest_m = std::min(cells[*at].lowest_m, height_m);
    cells[*at].highest_m = std::max(cells[*at].highest_m, height_m);
  }
  struct Nearest {
    double range_m = far_m, height_m = 0.0;
  };
  std::array<Nearest, directions> nearest;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (!(cells[i].highest_m - cells[i].lowest_m < flat_m && std::isfinite(cells[i].lowest_m)))
      continue;
    const double x = static_cast<double>(i % across) + 0.5 - reach_m;
    const double y = static_cast<double>(i / across) + 0.5 - reach_m;
    const double turns = std::atan2(y, x) / two_pi + 0.5;
    const auto direction = static_cast<std::size_t>(turns * directions) % directions;
    if (const double range_m = std::hypot(x, y); range_m < nearest[direction].range_m)
      nearest[direction] = {.range_m = range_m, .height_m = cells[i].lowest_m};
  }
  const auto is_seen = [](const Nearest& n) { return std::isfinite(n.range_m); };
  const auto is_off = [](const Nearest& n) { return std::abs(n.height_m) > on_m; };
  return std::ranges::count_if(nearest, is_off) * static_cast<std::ptrdiff_t>(max_off_of) <=
         std::ranges::count_if(nearest, is_seen);
}

/// A point of a strip of ground, and the metre along the strip that it lies in.
struct StripPoint {
  std::size_t metre = 0;
  double across_m = 0.0, height_m = 0.0;
};

constexpr double half_strip_m = 1.3;

/// What lies near the plane along its level line, in a strip whose middle is `middle_m` up the
/// slope from the lidar's foot: how far up the slope from that middle, and how high above the
/// plane.
std::vector<StripPoint> strip_of(const LevelPlane& plane, std::span<const Eigen::Vector3f> lowest,
                                 double middle_m) {
  constexpr double near_m = 0.5;
  const Eigen::Vector2d up_slope = plane.slope.normalized(), along(-up_slope.y(), up_slope.x());
  std::vector<StripPoint> strip;
  for (const Eigen::Vector3f& p : lowest) {
    const Eigen::Vector2d at = p.head<2>().cast<double>();
    const double across_m = up_slope.dot(at) - middle_m, height_m = above(plane, p);
    if (std::abs(across_m) > half_strip_m || std::abs(height_m) > near_m) continue;
    const double along_m = std::clamp(along.dot(at) + reach_m, 0.0, across - 0.5);
    strip.push_back({static_cast<std::size_t>(along_m), across_m, height_m});
  }
  return strip;
}

/// Regression of the heights in a strip on something across it.
struct Regression {
  std::size_t metres = 0;
  /// Sums of squared deviations of that, and of their products with those of the heights.
  double squares = 0.0, products = 0.0;

  /// The part of the squared heights that it accounts for [m²].
  [[nodiscard]] double explained_m2() const { return products * products / squares; }
};

/// On `predictor(across_m)`. Each metre of the strip has a height of its own: kerbs and platforms
/// across it say nothing.
template <typename Predictor>
Regression regression_on(Predictor predictor, std::span<const StripPoint> strip) {
  struct Sums {
    double points = 0.0, x = 0.0, height = 0.0, squares = 0.0, products = 0.0;
  };
  std::array<Sums, across> metres{};
  for (const StripPoint& p : strip) {
    const double x = predictor(p.across_m);
    Sums& sums = metres[p.metre];
    sums.points += 1.0;
    sums.x += x;
    sums.height += p.height_m;
    sums.squares += x * x;
    sums.products += x * p.height_m;
  }
  Regression regression;
  for (const Sums& sums : metres) {
    if (sums.points < 2.0) continue;
    ++regression.metres;
    regression.squares += sums.squares - sums.x * sums.x / sums.points;
    regression.products += sums.products - sums.x * sums.height / sums.points;
  }
  return regression;
}

/// Whether a step along the strip, as a kerb or the edge of a pavement, tells its heights better
/// than the slope across it does.
bool is_step(std::span<const StripPoint> strip, const Regression& slope) {
  constexpr int steps = 13;
  constexpr double first_m = -0.9, apart_m = 0.15;
  // Two metres with a point on either side.
  constexpr double min_squares = 1.0;
  for (int i = 0; i < steps; ++i) {
    const double step_m = first_m + i * apart_m;
    const Regression step =
        regression_on([&](double across_m) { return across_m > step_m ? 1.0 : 0.0; }, strip);
    if (step.squares > min_squares && step.explained_m2() > slope.explained_m2()) return true;
  }
  return false;
}

/// Whether such a strip rises across its middle by a third of what the plane does or less, and not
/// because of a step: beside a kerb either side of it may lean as the plane does.
bool is_strip_level(const LevelPlane& plane, std::span<const Eigen::Vector3f> lowest,
                    double middle_m) {
  constexpr double level_share = 0.65;
  constexpr std::size_t min_metres = 6;
  const std::vector<StripPoint> strip = strip_of(plane, lowest, middle_m);
  const Regression rise = regression_on([](double across_m) { return across_m; }, strip);
  return rise.metres >= min_metres &&
         rise.products < -level_share * plane.slope.norm() * rise.squares && !is_step(strip, rise);
}

/// Whether the lidar is on a level lane in a slope: however much of what is around lies on the
/// plane of that, the lane, which goes along the slope's level line, does not rise across that
/// line. The lidar may be nearer to one edge of it than to the other. Where no ground is seen there
/// nothing speaks for a lane. Strips of roads differ by as much as a slope that is no lean.
bool is_on_lane_in_slope(const LevelPlane& plane, std::span<const Eigen::Vector3f> lowest) {
  if (std::atan(plane.slope.norm()) < least_seen_tilt_rad) return false;
  return std::ranges::any_of(std::array{-1.0, 0.0, 1.0}, [&](double middle_m) {
    return is_strip_level(plane, lowest, middle_m);
  });
}

/// Entropy of the elevations of points far enough away for them not to matter where exactly the
/// beams start.
double entropy_of_elevations(std::span<const Eigen::Vector3f> points) {
  constexpr float far_m = 10.0F;
  constexpr double bin = 0.1 * rad_per_deg;
  constexpr std::size_t max_points = 20'000;
  std::array<std::uint32_t, 1801> histogram{};
  std::uint32_t counted = 0;
  const std::size_t step = points.size() / max_points + 1;
  for (std::size_t i = 0; i < points.size(); i += step) {
    const Eigen::Vector3f& p = points[i];
    if (!(p.squaredNorm() > far_m * far_m) || !p.allFinite()) continue;
    const double elevation = std::atan2(p.z(), p.head<2>().norm());
    ++histogram[static_cast<std::size_t>((elevation + 90.0 * rad_per_deg) / bin)];
    ++counted;
  }
  double entropy = 0.0;
  for (const std::uint32_t count : histogram) {
    const double share = static_cast<double>(count) / static_cast<double>(counted);
    if (count > 0) entropy -= share * std::log(share);
  }
  return entropy;
}

}  // namespace

bool has_fewer_elevations(std::span<const Eigen::Vector3f> these,
                          std::span<const Eigen::Vector3f> those) {
  // Scans of KITTI that are turned by 5 degrees have 0.2 to 0.3 less in their own axes, lidars that
  // lean 1.2 more in level ones.
  constexpr double clearly = 0.1;
  return entropy_of_elevations(these) < entropy_of_elevations(those) - clearly;
}

std::optional<LidarStance> stance_over_ground(std::span<const Eigen::Vector3f> points_lidar) {
  constexpr std::size_t min_cells = 100;
  constexpr double min_share = 0.3, min_height_m = 0.1, max_height_m = 4.0;
  const std::vector<Eigen::Vector3f> lowest = lowest_points(points_lidar);
  if (lowest.size() < min_cells) return std::nullopt;
  const auto plane = fit_level_plane(lowest, max_slope, min_share);
  if (!plane || !is_ground_of(*plane, lowest) || !is_plane_in_both_halves(*plane, lowest) ||
      has_another_grade(*plane, lowest) || !holds_beside_lidar(*plane, points_lidar) ||
      is_on_lane_in_slope(*plane, lowest))
    return std::nullopt;
  const Eigen::Vector3d normal = normal_of(*plane);
  const double height_m = -plane->height_m * normal.z();
  if (height_m < min_height_m || height_m > max_height_m) return std::nullopt;
  return LidarStance{
      .R_level_lidar =
          Eigen::Quaterniond::FromTwoVectors(normal, Eigen::Vector3d::UnitZ()).toRotationMatrix(),
      .tilt_rad = std::acos(std::clamp(normal.z(), -1.0, 1.0)),
      .height_m = height_m};
}

}  // namespace stillmap
