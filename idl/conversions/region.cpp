#include "idl/conversions/region.hpp"

#include <type_traits>
#include <utility>
#include <variant>

namespace stillmap::wire {
namespace {

using Message = stillmap_msgs::msg::Region;

namespace kinds = stillmap_msgs::msg::Region_Constants;

// A kind's number is the place of its alternative in stillmap::Region.
template <std::uint8_t kind>
using RegionOfKind = std::variant_alternative_t<kind, Region>;
static_assert(std::is_same_v<RegionOfKind<kinds::BOX>, BoxRegion> &&
              std::is_same_v<RegionOfKind<kinds::SPHERE>, SphereRegion> &&
              std::is_same_v<RegionOfKind<kinds::POLYGON>, PolygonRegion> &&
              std::is_same_v<RegionOfKind<kinds::CORRIDOR>, CorridorRegion>);

void set_heights(const HeightRange& heights, Message& message) {
  message.min_z(heights.min_m);
  message.max_z(heights.max_m);
}

void set_points(const std::vector<Eigen::Vector2d>& points_map, Message& message) {
  for (const Eigen::Vector2d& point : points_map) {
    message.x().push_back(point.x());
    message.y().push_back(point.y());
  }
}

void fill(const BoxRegion& box, Message& message) {
  message.min_x(box.box_map.min().x());
  message.min_y(box.box_map.min().y());
  message.min_z(box.box_map.min().z());
  message.max_x(box.box_map.max().x());
  message.max_y(box.box_map.max().y());
  message.max_z(box.box_map.max().z());
}

void fill(const SphereRegion& sphere, Message& message) {
  message.centre_x(sphere.centre_map.x());
  message.centre_y(sphere.centre_map.y());
  message.centre_z(sphere.centre_map.z());
  message.radius_m(sphere.radius_m);
}

void fill(const PolygonRegion& polygon, Message& message) {
  set_points(polygon.corners_map, message);
  set_heights(polygon.heights, message);
}

void fill(const CorridorRegion& corridor, Message& message) {
  set_points(corridor.path_map, message);
  set_heights(corridor.heights, message);
  message.half_width_m(corridor.half_width_m);
}

BoxRegion box_of(const Message& message) {
  BoxRegion box;
  box.box_map.min() = {message.min_x(), message.min_y(), message.min_z()};
  box.box_map.max() = {message.max_x(), message.max_y(), message.max_z()};
  return box;
}

std::vector<Eigen::Vector2d> points_of(const Message& message) {
  std::vector<Eigen::Vector2d> points_map;
  points_map.reserve(message.x().size());
  for (std::size_t i = 0; i < message.x().size(); ++i) {
    points_map.emplace_back(message.x()[i], message.y()[i]);
  }
  return points_map;
}

HeightRange heights_of(const Message& message) {
  return {.min_m = message.min_z(), .max_m = message.max_z()};
}

}  // namespace

Message to_wire(const Region& region) {
  Message message;
  message.kind(static_cast<std::uint8_t>(region.index()));
  std::visit([&](const auto& kind) { fill(kind, message); }, region);
  return message;
}

RegionFromWire from_wire(const Message& message) {
  if (message.x().size() != message.y().size()) {
    return {{},
            "region.x has " + std::to_string(message.x().size()) + " values and region.y has " +
                std::to_string(message.y().size()) + "; give an x and a y for every point"};
  }
  switch (message.kind()) {
    case kinds::BOX:
      return {box_of(message), {}};
    case kinds::SPHERE:
      return {
          SphereRegion{.centre_map = {message.centre_x(), message.centre_y(), message.centre_z()},
                       .radius_m = message.radius_m()},
          {}};
    case kinds::POLYGON:
      return {PolygonRegion{.corners_map = points_of(message), .heights = heights_of(message)}, {}};
    case kinds::CORRIDOR:
      return {CorridorRegion{.path_map = points_of(message),
                             .half_width_m = message.half_width_m(),
                             .heights = heights_of(message)},
              {}};
    default:
      return {{},
              "region.kind is " + std::to_string(message.kind()) +
                  "; must be 0 (box), 1 (sphere), 2 (polygon) or 3 (corridor)"};
  }
}

}  // namespace stillmap::wire
