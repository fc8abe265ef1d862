#include "core/simulation/city_truth.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/simulation/city.hpp"
#include "core/simulation/ray_scene.hpp"

namespace stillmap::simulation {
namespace {

/// Class of lidar points on that ground.
SemanticClass class_of(Zone zone, const CityPlan& plan) {
  switch (zone) {
    case Zone::road:
    case Zone::kerbside:
      return SemanticClass::road;
    case Zone::parking:
      return SemanticClass::parking;
    case Zone::sidewalk:
      return SemanticClass::sidewalk;
    case Zone::other:
      return SemanticClass::other_ground;
    case Zone::median:
      return plan.paved_medians ? SemanticClass::other_ground : SemanticClass::terrain;
    case Zone::verge:
    case Zone::lot:
      break;
  }
  return SemanticClass::terrain;
}

}  // namespace

struct CityTruth::World {
  explicit World(const SimulationConfig& config)
      : ground(config.plan, config.seed),
        city(build_city(ground, config.seed, config.day_seed())),
        scene(city.meshes(), city.standing_meshes()),
        standing(scene.with({})) {}

  [[nodiscard]] Eigen::Vector2d plan_of(const Eigen::Vector2d& spot_city) const;
  [[nodiscard]] Standing cast(const Ray& ray) const;
  [[nodiscard]] Standing cast_up(const Eigen::Vector3d& ground_city, double edge_m, double from_m,
                                 double to_m) const;
  [[nodiscard]] Standing cast_across(const Eigen::Vector3d& ground_city, double edge_m,
                                     double from_m, double to_m) const;

  GroundShape ground;
  City city;
  RayScene scene;
  RaySnapshot standing;
};

/// Inverse of `to_map` by fixed-point iteration; the error falls about tenfold in each round.
Eigen::Vector2d CityTruth::World::plan_of(const Eigen::Vector2d& spot_city) const {
  Eigen::Vector2d spot_plan = spot_city;
  for (int round = 0; round < 12; ++round) spot_plan += spot_city - ground.to_map(spot_plan);
  return spot_plan;
}

Standing CityTruth::World::cast(const Ray& ray) const {
  const std::optional<RayHit> hit = standing.cast(ray);
  if (!hit) return Standing::nothing;
  if (hit->body == 0) return Standing::fixed;
  const SemanticClass label = class_from_semantic_kitti(city.bodies[hit->body - 1].label);
  return is_movable(label) ? Standing::parked : Standing::fixed;
}

/// Casts up from the middle and near the corners: finds roofs and crowns.
Standing CityTruth::World::cast_up(const Eigen::Vector3d& ground_city, double edge_m, double from_m,
                                   double to_m) const {
  Standing found = Standing::nothing;
  for (const auto& [x, y] : {std::pair(0.0, 0.0), std::pair(0.4, 0.4), std::pair(-0.4, 0.4),
                             std::pair(0.4, -0.4), std::pair(-0.4, -0.4)}) {
    Ray ray;
    ray.origin_map = (ground_city + Eigen::Vector3d(x * edge_m, y * edge_m, from_m)).cast<float>();
    ray.direction_map = Eigen::Vector3f::UnitZ();
    ray.max_range_m = static_cast<float>(to_m - from_m);
    found = std::max(found, cast(ray));
  }
  return found;
}

/// Casts outwards from the middle at some heights: finds upright walls and poles.
Standing CityTruth::World::cast_across(const Eigen::Vector3d& ground_city, double edge_m,
                                       double from_m, double to_m) const {
  Standing found = Standing::nothing;
  for (const double share : {0.02, 0.2, 0.5, 0.9}) {
    const double height_m = from_m + share * (to_m - from_m);
    for (const Eigen::Vector3d& along : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0),
                                         Eigen::Vector3d(-1, 0, 0), Eigen::Vector3d(0, -1, 0)}) {
      Ray ray;
      ray.origin_map = (ground_city + Eigen::Vector3d(0, 0, height_m)).cast<float>();
      ray.direction_map = along.cast<float>();
      ray.max_range_m = static_cast<float>(0.5 * edge_m);
      found = std::max(found, cast(ray));
    }
  }
  return found;
}

CityTruth::CityTruth(const SimulationConfig& config) : world_(std::make_unique<World>(config)) {}
CityTruth::~CityTruth() = default;

TrueGround CityTruth::at(const Eigen::Vector2d& spot_city, double edge_m, double from_m,
                         double to_m) const {
  const Eigen::Vector2d spot_plan = world_->plan_of(spot_city);
  const CityPlan& plan = world_->ground.plan();
  const Zone zone = world_->ground.zone(spot_plan);
  TrueGround truth;
  truth.height_m = world_->ground.height(spot_plan, zone);
  truth.label = class_of(zone, plan);
  for (const double x : {-edge_m, 0.0, edge_m}) {
    for (const double y : {-edge_m, 0.0, edge_m}) {
      const Eigen::Vector2d beside_plan = world_->plan_of(spot_city + Eigen::Vector2d(x, y));
      const Zone beside = world_->ground.zone(beside_plan);
      const double height_m = world_->ground.height(beside_plan, beside);
      truth.is_edge = truth.is_edge || class_of(beside, plan) != truth.label;
      truth.step_m = std::max(truth.step_m, std::abs(height_m - truth.height_m));
    }
  }
  const Eigen::Vector3d ground_city(spot_city.x(), spot_city.y(), truth.height_m);
  truth.standing = std::max(world_->cast_up(ground_city, edge_m, from_m, to_m),
                            world_->cast_across(ground_city, edge_m, from_m, to_m));
  return truth;
}

}  // namespace stillmap::simulation
