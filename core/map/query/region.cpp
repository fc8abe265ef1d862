#include "core/map/query/region.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace stillmap {
namespace {

constexpr const char* coordinate_rule = "; coordinates are numbers within 1000000 m of the origin";

bool is_usable(const Eigen::Vector2d& p) {
  return (p.array().abs() <= max_region_coordinate_m).all();  // false for NaN
}

/// From lower to higher, each within reach or infinite.
void check_range(const std::string& what, double min_m, double max_m, std::ostream& faults) {
  const auto is_far = [](double value) {
    return std::isfinite(value) && std::abs(value) > max_region_coordinate_m;
  };
  if (!(min_m < max_m)) {  // also NaN
    faults << what << " is from " << min_m << " to " << max_m
           << " m; must be two numbers, the lower one first (infinity is allowed). ";
  } else if (is_far(min_m) || is_far(max_m)) {
    faults << what << " is from " << min_m << " to " << max_m << " m" << coordinate_rule
           << ", or infinite for no limit. ";
  }
}

void check_length(const std::string& what, double length_m, std::ostream& faults) {
  if (length_m > 0.0 && length_m <= max_region_coordinate_m) return;
  faults << what << " is " << length_m << "; must be above 0 and at most "
         << max_region_coordinate_m << " m. ";
}

/// False when one cannot be used.
bool check_points(const std::string& list, const std::string& item, std::size_t least,
                  const std::vector<Eigen::Vector2d>& points, std::ostream& faults) {
  if (points.size() < least || points.size() > max_region_points) {
    faults << list << " has " << points.size() << " " << item << "s; must have " << least << " to "
           << max_region_points << ". ";
    return false;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (is_usable(points[i])) continue;
    faults << list << " " << item << " " << i << " is (" << points[i].x() << ", " << points[i].y()
           << ")" << coordinate_rule << ". ";
    return false;
  }
  return true;
}

void check(const BoxRegion& box, std::ostream& faults) {
  const char* const names[] = {"box x", "box y", "box z"};
  for (int axis = 0; axis < 3; ++axis) {
    check_range(names[axis], box.box_map.min()[axis], box.box_map.max()[axis], faults);
  }
}

void check(const SphereRegion& sphere, std::ostream& faults) {
  const Eigen::Vector3d& centre = sphere.centre_map;
  if (!(centre.array().abs() <= max_region_coordinate_m).all()) {
    faults << "sphere centre is (" << centre.x() << ", " << centre.y() << ", " << centre.z() << ")"
           << coordinate_rule << ". ";
  }
  check_length("sphere radius_m", sphere.radius_m, faults);
}

void name_edge(const std::vector<Eigen::Vector2d>& corners, std::size_t edge, std::ostream& text) {
  const Eigen::Vector2d& from = corners[edge];
  const Eigen::Vector2d& to = corners[(edge + 1) % corners.size()];
  text << edge << " (from " << from.x() << ", " << from.y() << " to " << to.x() << ", " << to.y()
       << ")";
}

void check(const PolygonRegion& polygon, std::ostream& faults) {
  check_range("polygon z", polygon.heights.min_m, polygon.heights.max_m, faults);
  const std::vector<Eigen::Vector2d>& corners = polygon.corners_map;
  if (!check_points("polygon", "corner", 3, corners, faults)) return;
  const PolygonShape shape(corners);
  if (!shape.has_area()) {
    faults << "polygon has no area: its " << corners.size()
           << " corners lie on one line; give corners round an outline. ";
  } else if (const auto edges = shape.crossing()) {
    faults << "polygon edges ";
    name_edge(corners, edges->first, faults);
    faults << " and ";
    name_edge(corners, edges->second, faults);
    faults << " cross or touch; list the corners in their order round the outline, or ask for two "
              "polygons. ";
  }
}

void check(const CorridorRegion& corridor, std::ostream& faults) {
  check_range("corridor z", corridor.heights.min_m, corridor.heights.max_m, faults);
  check_length("corridor half_width_m", corridor.half_width_m, faults);
  const std::vector<Eigen::Vector2d>& path = corridor.path_map;
  if (!check_points("corridor path", "point", 2, path, faults)) return;
  if (std::ranges::all_of(path, [&](const Eigen::Vector2d& p) { return p == path.front(); })) {
    faults << "corridor path has no length: all " << path.size()
           << " points are the same; ask for a sphere. ";
  }
}

template <typename... Functions>
struct Cases : Functions... {
  using Functions::operator()...;
};
// Compilers before C++20's deduction for aggregates need it said.
template <typename... Functions>
Cases(Functions...) -> Cases<Functions...>;

Eigen::AlignedBox2d in_plan(const Eigen::AlignedBox3d& box) {
  return {box.min().head<2>(), box.max().head<2>()};
}

Eigen::AlignedBox3d upright(const Eigen::AlignedBox2d& plan, const HeightRange& heights) {
  return {Eigen::Vector3d(plan.min().x(), plan.min().y(), heights.min_m),
          Eigen::Vector3d(plan.max().x(), plan.max().y(), heights.max_m)};
}

const Region& checked(const Region& region) {
  if (const std::string faults = region_faults(region); !faults.empty()) {
    throw std::invalid_argument(faults);
  }
  return region;
}

Eigen::AlignedBox3d bounds_of(const Region& region) {
  return std::visit(
      Cases{[](const BoxRegion& box) { return box.box_map; },
            [](const SphereRegion& sphere) {
              const Eigen::Vector3d radius = Eigen::Vector3d::Constant(sphere.radius_m);
              return Eigen::AlignedBox3d(sphere.centre_map - radius, sphere.centre_map + radius);
            },
            [](const PolygonRegion& polygon) {
              Eigen::AlignedBox2d plan;
              for (const Eigen::Vector2d& corner : polygon.corners_map) plan.extend(corner);
              return upright(plan, polygon.heights);
            },
            [](const CorridorRegion& corridor) {
              const CorridorShape shape(corridor.path_map, corridor.half_width_m);
              return upright(shape.bounds_map(), corridor.heights);
            }},
      region);
}

}  // namespace

std::string region_faults(const Region& region) {
  std::ostringstream faults;
  std::visit([&](const auto& kind) { check(kind, faults); }, region);
  return faults.str();
}

RegionShape::RegionShape(const Eigen::AlignedBox3d& bounds_map, Shape shape)
    : bounds_map_(bounds_map), shape_(std::move(shape)) {}

RegionShape::RegionShape(const Region& region)
    : bounds_map_(bounds_of(checked(region))),
      shape_(std::visit(
          Cases{
              [](const BoxRegion&) { return Shape(WholeBounds{}); },
              [](const SphereRegion& sphere) { return Shape(sphere); },
              [](const PolygonRegion& polygon) { return Shape(PolygonShape(polygon.corners_map)); },
              [](const CorridorRegion& corridor) {
                return Shape(CorridorShape(corridor.path_map, corridor.half_width_m));
              }},
          region)) {}

bool RegionShape::contains(const Eigen::Vector3d& p_map) const {
  if (!bounds_map_.contains(p_map)) return false;
  return std::visit(Cases{[](const WholeBounds&) { return true; },
                          [&](const SphereRegion& sphere) {
                            return (p_map - sphere.centre_map).squaredNorm() <=
                                   sphere.radius_m * sphere.radius_m;
                          },
                          [&](const auto& plan) { return plan.contains(p_map.head<2>()); }},
                    shape_);
}

bool RegionShape::contains_mean(const Eigen::Vector3f& mean_map) const {
  return contains(mean_map.cast<double>());
}

bool RegionShape::may_intersect(const Eigen::AlignedBox3d& box_map) const {
  if (!bounds_map_.intersects(box_map)) return false;
  return std::visit(Cases{[](const WholeBounds&) { return true; },
                          [&](const SphereRegion& sphere) {
                            return box_map.squaredExteriorDistance(sphere.centre_map) <=
                                   sphere.radius_m * sphere.radius_m;
                          },
                          [&](const auto& plan) { return plan.intersects(in_plan(box_map)); }},
                    shape_);
}

bool RegionShape::covers(const Eigen::AlignedBox3d& box_map) const {
  if (!bounds_map_.contains(box_map)) return false;
  return std::visit(Cases{[](const WholeBounds&) { return true; },
                          [&](const SphereRegion& sphere) {
                            const Eigen::Vector3d farthest =
                                (box_map.max() - sphere.centre_map)
                                    .cwiseAbs()
                                    .cwiseMax((sphere.centre_map - box_map.min()).cwiseAbs());
                            return farthest.squaredNorm() <= sphere.radius_m * sphere.radius_m;
                          },
                          [&](const auto& plan) { return plan.covers(in_plan(box_map)); }},
                    shape_);
}

RegionShape RegionShape::restricted_to(const Eigen::AlignedBox3d& box_map) const {
  return {bounds_map_, std::visit(Cases{[](const WholeBounds& all) { return Shape(all); },
                                        [](const SphereRegion& sphere) { return Shape(sphere); },
                                        [&](const auto& plan) {
                                          return Shape(plan.restricted_to(in_plan(box_map)));
                                        }},
                                  shape_)};
}

}  // namespace stillmap
