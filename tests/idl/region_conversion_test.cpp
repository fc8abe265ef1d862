#include <gtest/gtest.h>

#include <limits>

#include "idl/conversions/region.hpp"

namespace stillmap::wire {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

template <typename Kind>
Kind there_and_back(const Kind& region) {
  const RegionFromWire back = from_wire(to_wire(Region(region)));
  EXPECT_TRUE(back.region) << back.fault;
  return std::get<Kind>(*back.region);
}

TEST(RegionConversion, KeepsBoxesAndSpheres) {
  BoxRegion box;
  box.box_map.min() = {-infinity, -2.0, -3.0};
  box.box_map.max() = {1.0, 2.0, infinity};
  EXPECT_EQ(there_and_back(box).box_map.min(), box.box_map.min());
  EXPECT_EQ(there_and_back(box).box_map.max(), box.box_map.max());
  const SphereRegion sphere{.centre_map = {1.5, -2.5, 3.5}, .radius_m = 4.5};
  EXPECT_EQ(there_and_back(sphere).centre_map, sphere.centre_map);
  EXPECT_EQ(there_and_back(sphere).radius_m, 4.5);
}

TEST(RegionConversion, KeepsPolygonsAndCorridors) {
  const PolygonRegion polygon{.corners_map = {{1, 2}, {3, 4}, {5, -6}}, .heights = {-1.0, 7.0}};
  EXPECT_EQ(there_and_back(polygon).corners_map, polygon.corners_map);
  EXPECT_EQ(there_and_back(polygon).heights.min_m, -1.0);
  EXPECT_EQ(there_and_back(polygon).heights.max_m, 7.0);
  const CorridorRegion corridor{
      .path_map = {{1, 2}, {3, 4}}, .half_width_m = 2.5, .heights = {-infinity, 2.0}};
  EXPECT_EQ(there_and_back(corridor).path_map, corridor.path_map);
  EXPECT_EQ(there_and_back(corridor).half_width_m, 2.5);
  EXPECT_EQ(there_and_back(corridor).heights.min_m, -infinity);
  EXPECT_EQ(there_and_back(corridor).heights.max_m, 2.0);
}

TEST(RegionConversion, RefusesKindsAndArraysThatDoNotExist) {
  auto message = to_wire(Region(BoxRegion()));
  message.kind(4);
  EXPECT_NE(from_wire(message).fault.find("region.kind is 4; must be 0 (box)"), std::string::npos);
  message = to_wire(Region(PolygonRegion{.corners_map = {{1, 2}, {3, 4}, {5, 6}}, .heights = {}}));
  message.y().pop_back();
  EXPECT_FALSE(from_wire(message).region);
  EXPECT_NE(from_wire(message).fault.find("region.x has 3 values and region.y has 2"),
            std::string::npos);
}

}  // namespace
}  // namespace stillmap::wire
