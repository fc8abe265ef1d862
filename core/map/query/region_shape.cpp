#include "core/map/query/region_shape.hpp"

#include <stdexcept>
#include <utility>

namespace stillmap {
namespace {

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
