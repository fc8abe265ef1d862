#include "core/simulation/city_plan.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "core/simulation/city.hpp"

namespace stillmap::simulation {
namespace {

using testing::HasSubstr;

TEST(CityPlan, PresetsAreWithoutFault) {
  for (const char* name : {"quiet", "crowd", "yard"}) {
    EXPECT_EQ(city_plan(name).faults(), "") << name;
    EXPECT_EQ(city_plan(name).name, name);
  }
}

TEST(CityPlan, UnknownNameSaysWhichExist) {
  try {
    (void)city_plan("rome");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("rome"), HasSubstr("quiet")));
  }
}

TEST(CityPlan, NamesEveryFault) {
  CityPlan plan = test_yard();
  plan.route[1].x() += 3.0;
  plan.ego_lane = 4;
  plan.traffic.vehicles_per_km = -1.0;
  plan.traffic.speed_mps = 0.0;
  plan.bend_length_m = 0.0;
  plan.turn_radius_m = 1.0;
  const std::string faults = plan.faults();
  for (const char* field :
       {"route leg", "ego_lane", "vehicles_per_km", "speed_mps", "bend_m", "turn_radius_m"}) {
    EXPECT_THAT(faults, HasSubstr(field));
  }
}

TEST(CityPlan, StreetsMustBeInOrderAndApart) {
  CityPlan plan = test_yard();
  std::swap(plan.streets_along_u.front(), plan.streets_along_u.back());
  EXPECT_THAT(plan.faults(), HasSubstr("streets_along_u"));
  plan = test_yard();
  plan.streets_along_v.push_back({61.0, {}});
  EXPECT_THAT(plan.faults(), HasSubstr("streets_along_v"));
  plan.streets_along_v.clear();
  EXPECT_THAT(plan.faults(), HasSubstr("streets_along_v"));
}

class Ground : public testing::Test {
 protected:
  CityPlan plan_ = test_yard();
  GroundShape ground_{plan_, 3};
};

TEST_F(Ground, KerbIsAStepOfItsHeight) {
  const double kerb = plan_.route_profile.half_road_m();
  const Eigen::Vector2d spot(30.0, kerb);
  EXPECT_EQ(ground_.zone({30.0, kerb - 0.01}), Zone::parking);
  EXPECT_EQ(ground_.zone({30.0, kerb + 0.01}), Zone::sidewalk);
  EXPECT_NEAR(ground_.height(spot, Zone::sidewalk) - ground_.height(spot, Zone::parking), 0.13,
              1e-9);
}

TEST_F(Ground, WithoutBaysVehiclesParkOnTheRoad) {
  for (std::vector<StreetPlan>* streets : {&plan_.streets_along_u, &plan_.streets_along_v})
    for (StreetPlan& street : *streets) street.profile.has_bays = false;
  plan_.route_profile.has_bays = false;
  const GroundShape unmarked(plan_, 3);
  const Eigen::Vector2d bay(30.0, plan_.route_profile.half_road_m() - 0.5);
  EXPECT_EQ(ground_.zone(bay), Zone::parking);
  EXPECT_EQ(unmarked.zone(bay), Zone::kerbside);
  // At the same height as the road, and of its asphalt.
  EXPECT_EQ(unmarked.height(bay, Zone::kerbside), unmarked.height(bay, Zone::road));
  const auto count = [](const GroundShape& ground, Surface surface) {
    Mesh mesh;
    add_ground(mesh, ground);
    return std::ranges::count(mesh.surfaces, surface);
  };
  EXPECT_GT(count(ground_, Surface::parking_bay), 100);
  EXPECT_EQ(count(unmarked, Surface::parking_bay), 0);
  // As many vehicles as in bays, none of them elsewhere.
  const auto parked = [](const GroundShape& ground) {
    const City city = build_city(ground, 5, 5);
    return std::ranges::count(city.bodies, standing_label(ObjectKind::car), &Body::label);
  };
  EXPECT_GT(parked(unmarked), 5);
  EXPECT_EQ(parked(unmarked), parked(ground_));
}

TEST_F(Ground, LinesArePaintedAsThePlanSays) {
  const auto lines = [this] {
    Mesh mesh;
    add_lane_markings(mesh, GroundShape(plan_, 3));
    return mesh.surfaces.size();
  };
  const std::size_t all = lines();
  plan_.edge_lines = false;
  const std::size_t between_lanes = lines();
  plan_.lane_lines = false;
  const std::size_t none = lines();
  EXPECT_LT(between_lanes, all);
  EXPECT_LT(none, between_lanes);
}

TEST_F(Ground, JunctionIsRoadAndHasNoParking) {
  EXPECT_EQ(ground_.zone({0.0, 0.0}), Zone::road);
  EXPECT_EQ(ground_.zone({0.0, 5.9}), Zone::road);
  EXPECT_EQ(ground_.zone(
                {plan_.route_profile.half_road_m() + 3.0, plan_.route_profile.half_road_m() - 0.5}),
            Zone::road);
}

TEST_F(Ground, YardsArePavedAsFarAsThePlanSays) {
  const double back = plan_.route_profile.half_street_m();
  const Eigen::Vector2d near(30.0, back + 3.0), far(30.0, back + 13.0);
  EXPECT_FALSE(ground_.is_paved_yard(near));
  plan_.share_paved_yards = 1.0;
  const GroundShape paved(plan_, 3);
  ASSERT_EQ(paved.zone(near), Zone::lot);
  EXPECT_TRUE(paved.is_paved_yard(near));
  EXPECT_FALSE(paved.is_paved_yard(far));
  const auto slabs = [](const GroundShape& ground) {
    Mesh mesh;
    add_ground(mesh, ground);
    return std::ranges::count(mesh.surfaces, Surface::pavement);
  };
  EXPECT_GT(slabs(paved), slabs(ground_) + 100);
}

TEST_F(Ground, CrashBarriersStandAlongOpenLand) {
  plan_.many_shapes = true;
  plan_.blocks.share_open = 1.0;
  plan_.blocks.share_fence = plan_.blocks.share_hedge = plan_.blocks.share_wall = 0.0;
  const std::size_t without = build_city(GroundShape(plan_, 3), 5, 5).bodies.size();
  plan_.blocks.share_barrier = 1.0;
  EXPECT_GT(build_city(GroundShape(plan_, 3), 5, 5).bodies.size(), without + 20);
}

TEST_F(Ground, FramesStandUprightOrLeanALittle) {
  const Eigen::Isometry3d upright = ground_.frame_at({20, 0}, 0.4);
  EXPECT_NEAR((upright.linear() * Eigen::Vector3d::UnitZ()).z(), 1.0, 1e-12);
  const Eigen::Isometry3d leaning = ground_.leaning_frame_at({20, -1.6}, 0.4, 2.6);
  EXPECT_GT((leaning.linear() * Eigen::Vector3d::UnitZ()).z(), 0.98);
  EXPECT_NEAR(leaning.linear().determinant(), 1.0, 1e-12);
}

TEST_F(Ground, CityIsTheSameForTheSameSeedOnly) {
  const City a = build_city(ground_, 5, 5);
  const City b = build_city(ground_, 5, 5);
  const City c = build_city(ground_, 6, 6);
  EXPECT_EQ(a.fixed.vertices, b.fixed.vertices);
  EXPECT_EQ(a.bodies.size(), b.bodies.size());
  EXPECT_NE(a.fixed.vertices, c.fixed.vertices);
}

TEST_F(Ground, AnotherDayParksOtherVehiclesInTheSameCity) {
  const City monday = build_city(ground_, 5, 5);
  const City tuesday = build_city(ground_, 5, 6);
  EXPECT_EQ(monday.fixed.vertices, tuesday.fixed.vertices);
  const auto parked = [](const City& city) {
    std::vector<Eigen::Vector3d> places;
    for (const Body& body : city.bodies)
      if (body.label == 10) places.emplace_back(body.T_map_body.translation());
    return places;
  };
  EXPECT_GT(parked(tuesday).size(), 10U);
  EXPECT_NE(parked(monday), parked(tuesday));
}

TEST_F(Ground, ParkedVehiclesStandInBaysApartFromEachOther) {
  const City city = build_city(ground_, 5, 5);
  std::vector<const Body*> parked;
  for (const Body& body : city.bodies) {
    if (body.label == 10) parked.push_back(&body);
  }
  ASSERT_GT(parked.size(), 10U);
  for (std::size_t i = 0; i < parked.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Eigen::Isometry3d T_i_j = parked[i]->T_map_body.inverse() * parked[j]->T_map_body;
      EXPECT_GT(T_i_j.translation().norm(), 5.3);
      EXPECT_NE(parked[i]->instance, parked[j]->instance);
    }
  }
}

}  // namespace
}  // namespace stillmap::simulation
