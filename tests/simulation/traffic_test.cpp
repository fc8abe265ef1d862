#include "core/simulation/traffic.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace stillmap::simulation {
namespace {

// Outline on the ground.
struct Footprint {
  Eigen::Vector2d centre, ahead;
  double length_m, width_m;
};

Footprint footprint(const Eigen::Isometry3d& T_map_body, double length_m, double width_m) {
  return {T_map_body.translation().head<2>(), T_map_body.linear().col(0).head<2>().normalized(),
          length_m, width_m};
}

double reach(const Footprint& f, const Eigen::Vector2d& axis) {
  const Eigen::Vector2d left(-f.ahead.y(), f.ahead.x());
  return 0.5 * (f.length_m * std::abs(f.ahead.dot(axis)) + f.width_m * std::abs(left.dot(axis)));
}

// Separating axes of two rectangles.
bool overlap(const Footprint& a, const Footprint& b) {
  for (const Footprint* f : {&a, &b}) {
    for (const Eigen::Vector2d& axis : {f->ahead, Eigen::Vector2d(-f->ahead.y(), f->ahead.x())}) {
      if (std::abs((b.centre - a.centre).dot(axis)) > reach(a, axis) + reach(b, axis)) return false;
    }
  }
  return true;
}

class TrafficOn : public testing::TestWithParam<const char*> {
 protected:
  // Mirrors, arms and handlebars may pass each other closely.
  [[nodiscard]] Footprint of(const Mover& mover, double time_s) const {
    const ObjectShape& shape = traffic_.shapes()[mover.shape];
    return footprint(traffic_.body_at(mover, time_s).T_map_body, 0.97 * shape.length_m,
                     0.85 * shape.width_m);
  }

  CityPlan plan_ = city_plan(GetParam());
  GroundShape ground_{plan_, 2};
  City city_ = build_city(ground_, 2, 2);
  Traffic traffic_{ground_, 2, {0.0, 60.0}, city_.instances};
};

TEST_P(TrafficOn, RoadUsersNeverOverlapEachOtherOrTheEgoVehicle) {
  for (double t = 0.0; t < 60.0; t += 1.5) {
    std::vector<Footprint> footprints{footprint(traffic_.T_map_ego_at(t), 4.6, 1.8)};
    for (const Mover& mover : traffic_.movers()) {
      if (traffic_.shapes()[mover.shape].kind == ObjectKind::person) continue;
      footprints.push_back(of(mover, t));
    }
    for (std::size_t i = 0; i < footprints.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        EXPECT_FALSE(overlap(footprints[i], footprints[j])) << t << ": " << i << ' ' << j;
      }
    }
  }
}

TEST_P(TrafficOn, NobodyDrivesThroughParkedVehicles) {
  std::vector<Footprint> parked;
  for (const Body& body : city_.bodies) {
    if (body.label == 10) parked.push_back(footprint(body.T_map_body, 4.2, 1.75));
  }
  for (double t = 0.0; t < 60.0; t += 2.0) {
    const Footprint ego = footprint(traffic_.T_map_ego_at(t), 4.6, 1.8);
    for (const Footprint& car : parked) EXPECT_FALSE(overlap(ego, car)) << t;
    for (const Mover& mover : traffic_.movers()) {
      const Footprint moving = of(mover, t);
      for (const Footprint& car : parked) EXPECT_FALSE(overlap(moving, car)) << t;
    }
  }
}

TEST_P(TrafficOn, WheelsStayOnTheRoadAndPeopleOnTheGround) {
  for (double t = 0.0; t < 60.0; t += 3.0) {
    for (const Mover& mover : traffic_.movers()) {
      const Body body = traffic_.body_at(mover, t);
      const Eigen::Vector3d up = body.T_map_body.linear().col(2);
      EXPECT_GT(up.z(), 0.97);
      EXPECT_LT(std::abs(body.T_map_body.translation().z()), 2.0 * plan_.hill_m + 0.6);
    }
  }
}

TEST_P(TrafficOn, MovingLabelsGoWithMotion) {
  int moving = 0;
  for (const Mover& mover : traffic_.movers()) {
    const Body now = traffic_.body_at(mover, 30.0);
    const Body later = traffic_.body_at(mover, 30.1);
    const double moved = (later.T_map_body.translation() - now.T_map_body.translation()).norm();
    const bool labelled = now.label >= 252 && now.label <= 259;
    if (moved > 0.03) {
      EXPECT_TRUE(labelled);
      ++moving;
    }
    if (moved < 0.002) {
      EXPECT_FALSE(labelled);
    }
  }
  EXPECT_GT(moving, 0);
}

TEST_P(TrafficOn, EveryMoverHasAnInstanceOfItsOwn) {
  std::vector<std::uint16_t> instances;
  for (const Body& body : city_.bodies) {
    if (body.instance != 0) instances.push_back(body.instance);
  }
  for (const Mover& mover : traffic_.movers()) instances.push_back(mover.instance);
  std::ranges::sort(instances);
  EXPECT_EQ(std::ranges::adjacent_find(instances), instances.end());
}

INSTANTIATE_TEST_SUITE_P(Plans, TrafficOn, testing::Values("quiet", "crowd", "yard"),
                         [](const auto& info) { return std::string(info.param); });

TEST(Crowd, StandsAtRedAndFlowsAtGreen) {
  const CityPlan plan = crowded_avenue();
  const GroundShape ground(plan, 2);
  const Traffic traffic(ground, 2, {0.0, 90.0}, 0);
  double standing = 0.0;
  double driving = 0.0;
  for (double t = 0.0; t < 90.0; t += 5.0) {
    for (const Mover& mover : traffic.movers()) {
      if (traffic.shapes()[mover.shape].kind != ObjectKind::car) continue;
      (mover.track.speed_at(t) < 0.1 ? standing : driving) += 1.0;
    }
  }
  EXPECT_GT(standing / (standing + driving), 0.03);
  EXPECT_GT(driving / (standing + driving), 0.5);
}

}  // namespace
}  // namespace stillmap::simulation
