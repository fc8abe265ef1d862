#include "core/map/query/region.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "tests/numbers.hpp"

namespace stillmap {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using ::testing::AllOf;
using ::testing::HasSubstr;

using test::infinity;
using test::nan;

std::vector<Vector2d> star(int corners, double size_m, std::mt19937& random) {
  std::uniform_real_distribution<double> radius(0.3 * size_m, size_m);
  std::vector<Vector2d> points;
  for (int i = 0; i < corners; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / corners;
    points.push_back(radius(random) * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return points;
}

/// Sum of the angles under which the outline is seen: a full turn from inside.
bool winds_round(const std::vector<Vector2d>& corners, const Vector2d& p) {
  double turned = 0.0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vector2d a = corners[i] - p;
    const Vector2d b = corners[(i + 1) % corners.size()] - p;
    turned += std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
  }
  return std::abs(turned) > std::numbers::pi;
}

double path_distance(const std::vector<Vector2d>& path, const Vector2d& p) {
  double nearest = infinity;
  for (std::size_t i = 0; i + 1 < path.size(); ++i) {
    for (int step = 0; step <= 20'000; ++step) {
      nearest =
          std::min(nearest, (path[i] + (path[i + 1] - path[i]) * (step / 20'000.0) - p).norm());
    }
  }
  return nearest;
}

std::vector<Region> random_regions(std::mt19937& random) {
  std::uniform_real_distribution<double> coordinate(-40.0, 40.0);
  const auto plan = [&] { return Vector2d(coordinate(random), coordinate(random)); };
  BoxRegion box;
  box.box_map = AlignedBox3d(Vector3d(-11, -7, -2), Vector3d(13, 25, 3));
  PolygonRegion polygon{.corners_map = star(17, 38.0, random), .heights = {-1.0, 4.0}};
  if (random() % 2 == 0) std::ranges::reverse(polygon.corners_map);
  return {box, SphereRegion{.centre_map = {coordinate(random) / 4.0, 3.0, 1.0}, .radius_m = 17.0},
          polygon,
          CorridorRegion{.path_map = {plan(), plan(), plan(), plan()},
                         .half_width_m = 3.0,
                         .heights = {-infinity, 2.0}}};
}

TEST(Region, ShapesAgreeWithPlainGeometry) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate(-45.0, 45.0);
  const PolygonRegion polygon{.corners_map = star(31, 40.0, random), .heights = {}};
  const CorridorRegion corridor{
      .path_map = {{-30, -30}, {0, 10}, {0, 10}, {30, -5}}, .half_width_m = 4.0, .heights = {}};
  const RegionShape polygon_shape{Region(polygon)};
  const RegionShape corridor_shape{Region(corridor)};
  for (int i = 0; i < 300; ++i) {
    const Vector3d p(coordinate(random), coordinate(random), coordinate(random));
    EXPECT_EQ(polygon_shape.contains(p), winds_round(polygon.corners_map, p.head<2>()));
    const double distance = path_distance(corridor.path_map, p.head<2>());
    if (std::abs(distance - corridor.half_width_m) > 1e-3) {
      EXPECT_EQ(corridor_shape.contains(p), distance < corridor.half_width_m);
    }
  }
}

TEST(Region, BoxTestsNeverContradictPositionsInTheBox) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> coordinate(-45.0, 45.0);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  int covered = 0;
  int missed = 0;
  for (int i = 0; i < 600; ++i) {
    for (const Region& region : random_regions(random)) {
      const RegionShape shape(region);
      const Vector3d corner(coordinate(random), coordinate(random), coordinate(random) / 10.0);
      const AlignedBox3d box(corner, corner + Vector3d(8.0, 8.0, 1.0) * share(random));
      const bool may_intersect = shape.may_intersect(box);
      const bool covers = shape.covers(box);
      const RegionShape near = shape.restricted_to(box);
      covered += covers ? 1 : 0;
      missed += may_intersect ? 0 : 1;
      for (int k = 0; k < 20; ++k) {
        const Vector3d p = box.min() + box.sizes().cwiseProduct(
                                           Vector3d(share(random), share(random), share(random)));
        const bool inside = shape.contains(p);
        EXPECT_LE(inside, may_intersect);
        EXPECT_GE(inside, covers);
        EXPECT_EQ(near.contains(p), inside);
        EXPECT_LE(inside, shape.bounds_map().contains(p));
      }
    }
  }
  EXPECT_GT(covered, 20);
  EXPECT_GT(missed, 200);
}

TEST(Region, OutlinesBelongToTheirPolygonHoweverFarAway) {
  for (const double far_m : {0.0, 99'990.0, -99'990.0}) {
    const Vector2d at(far_m, -far_m);
    const PolygonRegion polygon{
        .corners_map = {at, at + Vector2d(0.3, 0.1), at + Vector2d(0.2, 0.5)}, .heights = {}};
    const RegionShape shape{Region(polygon)};
    for (const Vector2d& corner : polygon.corners_map) {
      EXPECT_TRUE(shape.contains({corner.x(), corner.y(), 0.0}));
    }
    const Vector2d middle = at + Vector2d(0.15, 0.2);
    EXPECT_TRUE(shape.contains({middle.x(), middle.y(), 0.0}));
    // A tenth of a millimetre outside of the edge from the first corner to the second.
    const Vector2d outside = at + Vector2d(0.15, 0.05 - 1e-4);
    EXPECT_FALSE(shape.contains({outside.x(), outside.y(), 0.0}));
  }
}

TEST(Region, HeightsBoundPolygonsAndCorridors) {
  const RegionShape polygon{Region(
      PolygonRegion{.corners_map = {{0, 0}, {4, 0}, {4, 4}, {0, 4}}, .heights = {1.0, 2.0}})};
  EXPECT_TRUE(polygon.contains({2, 2, 1.0}));
  EXPECT_FALSE(polygon.contains({2, 2, 0.9}));
  EXPECT_FALSE(polygon.may_intersect(AlignedBox3d(Vector3d(1, 1, 3), Vector3d(2, 2, 4))));
  const RegionShape corridor{Region(CorridorRegion{
      .path_map = {{0, 0}, {9, 0}}, .half_width_m = 1.0, .heights = {-infinity, 0.0}})};
  EXPECT_TRUE(corridor.contains({5, 0.5, -1e9}));
  EXPECT_FALSE(corridor.contains({5, 0.5, 0.1}));
  EXPECT_FALSE(corridor.contains({nan, 0.0, 0.0}));
}

TEST(Region, AcceptsWhatIsOnlyUnusual) {
  // The first corner again at the end, a corner twice, corners on a straight edge, either way
  // round, and no limits.
  PolygonRegion square{.corners_map = {{0, 0}, {2, 0}, {4, 0}, {4, 4}, {4, 4}, {0, 4}, {0, 0}},
                       .heights = {}};
  EXPECT_EQ(region_faults(square), "");
  std::ranges::reverse(square.corners_map);
  EXPECT_EQ(region_faults(square), "");
  EXPECT_EQ(region_faults(BoxRegion()), "");
  EXPECT_TRUE(RegionShape{Region(BoxRegion())}.contains({1e300, -1e300, 0}));
  // A path may cross itself.
  EXPECT_EQ(region_faults(CorridorRegion{
                .path_map = {{0, 0}, {9, 0}, {9, 9}, {4, -9}}, .half_width_m = 1.0, .heights = {}}),
            "");
}

TEST(Region, NamesTheEdgesThatCross) {
  const auto faults = [](std::vector<Vector2d> corners) {
    return region_faults(PolygonRegion{.corners_map = std::move(corners), .heights = {}});
  };
  // A bow tie.
  EXPECT_THAT(faults({{0, 0}, {10, 10}, {10, 0}, {0, 10}}),
              AllOf(HasSubstr("edges 0 (from 0, 0 to 10, 10) and 2 (from 10, 0 to 0, 10)"),
                    HasSubstr("order round the outline")));
  // A corner on another edge.
  EXPECT_THAT(faults({{0, 0}, {10, 0}, {10, 10}, {5, 0}, {0, 10}}), HasSubstr("cross or touch"));
  // An edge that goes back on the one before.
  EXPECT_THAT(faults({{0, 0}, {10, 0}, {4, 0}, {4, 5}}), HasSubstr("edges 0"));
  // Only just: a millimetre, 100 km away.
  const Vector2d at(1e5, 1e5);
  EXPECT_THAT(faults({at, at + Vector2d(10, 0), at + Vector2d(10, 5), at + Vector2d(5, -0.001),
                      at + Vector2d(0, 5)}),
              HasSubstr("cross"));
  EXPECT_EQ(faults({at, at + Vector2d(10, 0), at + Vector2d(10, 5), at + Vector2d(5, 0.001),
                    at + Vector2d(0, 5)}),
            "");
}

TEST(Region, FindsTheCrossingOfALargeOutline) {
  std::mt19937 random(2);
  PolygonRegion polygon{.corners_map = star(4000, 500.0, random), .heights = {}};
  EXPECT_EQ(region_faults(polygon), "");
  std::swap(polygon.corners_map[1000], polygon.corners_map[3000]);
  EXPECT_THAT(region_faults(polygon), HasSubstr("cross"));
}

struct HostileRegion {
  Region region;
  std::string named;
};

BoxRegion box(const Vector3d& min, const Vector3d& max) {
  BoxRegion region;
  region.box_map.min() = min;
  region.box_map.max() = max;
  return region;
}

PolygonRegion polygon(std::vector<Vector2d> corners, HeightRange heights = {}) {
  return {.corners_map = std::move(corners), .heights = heights};
}

CorridorRegion corridor(std::vector<Vector2d> path, double half_width_m, HeightRange heights = {}) {
  return {.path_map = std::move(path), .half_width_m = half_width_m, .heights = heights};
}

TEST(Region, RefusesNonsenseAndNamesFieldAndValue) {
  const std::vector<Vector2d> triangle{{0, 0}, {1, 0}, {0, 1}};
  const std::vector<HostileRegion> all{
      {box({nan, 0, 0}, {1, 1, 1}), "box x is from nan to 1"},
      {box({0, 5, 0}, {1, -5, 1}), "box y is from 5 to -5"},
      {box({0, 0, 2}, {1, 1, 2}), "box z is from 2 to 2"},
      {box({-1e9, 0, 0}, {1e9, 1, 1}),
       "box x is from -1e+09 to 1e+09 m; coordinates are numbers within"},
      {box({infinity, 0, 0}, {infinity, 1, 1}), "box x is from inf to inf"},
      {SphereRegion{.centre_map = {0, nan, 0}, .radius_m = 1.0}, "sphere centre is (0, nan, 0)"},
      {SphereRegion{.centre_map = {0, 0, 1e9}, .radius_m = 1.0}, "sphere centre is (0, 0, 1e+09)"},
      {SphereRegion{}, "sphere radius_m is 0; must be above 0"},
      {SphereRegion{.centre_map = Vector3d::Zero(), .radius_m = infinity},
       "sphere radius_m is inf"},
      {SphereRegion{.centre_map = Vector3d::Zero(), .radius_m = nan}, "sphere radius_m is nan"},
      {polygon({}), "polygon has 0 corners; must have 3 to 4096"},
      {polygon({{0, 0}, {1, 1}}), "polygon has 2 corners"},
      {polygon(std::vector<Vector2d>(5000)), "polygon has 5000 corners"},
      {polygon({{0, 0}, {1, nan}, {2, 0}}), "polygon corner 1 is (1, nan)"},
      {polygon({{0, 0}, {1, 0}, {0, 1e9}}), "polygon corner 2 is (0, 1e+09)"},
      {polygon({{1, 1}, {2, 2}, {3, 3}}), "polygon has no area"},
      {polygon({{1, 1}, {1, 1}, {1, 1}}), "polygon has no area"},
      {polygon(triangle, {2.0, 1.0}), "polygon z is from 2 to 1"},
      {polygon(triangle, {nan, 1.0}), "polygon z is from nan to 1"},
      {corridor({}, 1.0), "corridor path has 0 points; must have 2"},
      {corridor({{1, 1}}, 1.0), "corridor path has 1 points"},
      {corridor({{1, 1}, {1, 1}}, 1.0), "corridor path has no length"},
      {corridor({{1, 1}, {infinity, 1}}, 1.0), "corridor path point 1 is (inf, 1)"},
      {corridor({{1, 1}, {2, 1}}, -1.0), "corridor half_width_m is -1"},
      {corridor({{1, 1}, {2, 1}}, 0.0), "corridor half_width_m is 0"},
      {corridor({{1, 1}, {2, 1}}, 1.0, {1e9, 2e9}), "corridor z is from 1e+09 to 2e+09"}};
  for (const auto& [region, named] : all) {
    EXPECT_THAT(region_faults(region), HasSubstr(named));
    EXPECT_THROW(RegionShape{region}, std::invalid_argument);
  }
}

}  // namespace
}  // namespace stillmap
