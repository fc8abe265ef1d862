#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "core/simulation/city_plan.hpp"
#include "core/simulation/mesh.hpp"

namespace stillmap::simulation {

/// Maps flat plan coordinates (u, v) to the ground in the map frame, with bends, hills, crowned
/// roads, kerbs and rough grass.
class GroundShape {
 public:
  GroundShape(CityPlan plan, std::uint64_t seed);

  [[nodiscard]] const CityPlan& plan() const { return plan_; }
  [[nodiscard]] Zone zone(const Eigen::Vector2d& spot_plan) const;
  /// True where a lot is paved.
  [[nodiscard]] bool is_paved_yard(const Eigen::Vector2d& spot_plan) const;
  /// Height of the bare surface at `spot_plan` if it belongs to `zone` [m, map frame].
  [[nodiscard]] double height(const Eigen::Vector2d& spot_plan, Zone zone) const;
  /// The point of the map on the ground at `spot_plan`.
  [[nodiscard]] Eigen::Vector3d on_ground(const Eigen::Vector2d& spot_plan) const;
  [[nodiscard]] Eigen::Vector3d on_ground(const Eigen::Vector2d& spot_plan, Zone zone) const;
  [[nodiscard]] Eigen::Vector2d to_map(const Eigen::Vector2d& spot_plan) const;
  /// T_map_frame of an upright frame on the ground, x along the bent `heading_plan` [rad].
  [[nodiscard]] Eigen::Isometry3d frame_at(const Eigen::Vector2d& spot_plan,
                                           double heading_plan) const;
  /// T_map_frame that leans with the ground under axles `wheelbase_m` apart.
  [[nodiscard]] Eigen::Isometry3d leaning_frame_at(const Eigen::Vector2d& spot_plan,
                                                   double heading_plan, double wheelbase_m) const;

 private:
  [[nodiscard]] double embankment(const Eigen::Vector2d& spot_plan) const;
  [[nodiscard]] double kerb(const Eigen::Vector2d& spot_plan) const;
  [[nodiscard]] double bump(const Eigen::Vector2d& spot_plan) const;

  CityPlan plan_;
  Eigen::Array<double, 8, 1> phase_;
};

/// Roads, kerbs, sidewalks and grass of the whole city, in the map frame.
void add_ground(Mesh& mesh, const GroundShape& ground);

/// Lane lines, stop lines and zebra crossings along the route, 6 mm above the road.
void add_lane_markings(Mesh& mesh, const GroundShape& ground);

}  // namespace stillmap::simulation
