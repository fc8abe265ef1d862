#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace stillmap::simulation {

/// Use of a spot of ground; `kerbside` is road on which cars park.
enum class Zone : std::uint8_t { road, kerbside, parking, median, verge, sidewalk, lot, other };

/// A rectangle of the plan between the streets other than garden: a car park, a gravel yard.
struct GroundPatch {
  Eigen::AlignedBox2d area_plan;
  Zone zone = Zone::other;
};

/// Cross-section of a street from its centre line outwards, the same on both sides [m].
struct StreetProfile {
  double half_median_m = 0.0;
  int lanes = 1;
  double lane_width_m = 3.2;
  double bike_lane_m = 1.3;
  double parking_m = 2.2;
  /// Without bays of their own, cars park on the road.
  bool has_bays = true;
  double verge_m = 0.0;
  double sidewalk_m = 2.6;

  [[nodiscard]] double lane_centre_m(int lane) const {
    return half_median_m + (lane + 0.5) * lane_width_m;
  }
  [[nodiscard]] double bike_centre_m() const {
    return half_median_m + lanes * lane_width_m + 0.5 * bike_lane_m;
  }
  /// From the centre line to the start of the parking bays, to the kerb, to the back of the
  /// sidewalk.
  [[nodiscard]] double half_driven_m() const {
    return half_median_m + lanes * lane_width_m + bike_lane_m;
  }
  [[nodiscard]] double half_road_m() const { return half_driven_m() + parking_m; }
  [[nodiscard]] double half_street_m() const { return half_road_m() + verge_m + sidewalk_m; }
};

/// A straight street in plan coordinates, all across the city: u = position or v = position.
struct StreetPlan {
  double position_m = 0.0;
  StreetProfile profile;
};

/// Moving objects and their density, in objects per kilometre of one lane along the route.
struct TrafficPlan {
  double vehicles_per_km = 4.0;
  /// Shares of the vehicles. Long ones sweep over the next lane in turns of less than 20 m radius.
  double share_trucks = 0.0;
  double share_buses = 0.0;
  /// A lorry and a bus drive beside the ego vehicle at its speed, so that most of what the lidar
  /// sees moves with it.
  bool escorted = false;
  double cyclists_per_km = 2.0;
  double pedestrians_per_km = 6.0;
  /// People who cross the road while the light for vehicles is red.
  int crossing_pedestrians = 2;
  double speed_mps = 9.0;
  /// Largest deviation of a driver's desired speed, as a share of `speed_mps`.
  double speed_spread = 0.15;
  /// Period and red part of every pedestrian light [s].
  double light_period_s = 60.0;
  double light_red_s = 10.0;
  int parked_per_100m = 9;
  /// Shares of the vehicles, as `share_trucks`.
  double share_motorcyclists = 0.0;
  double share_other_vehicles = 0.0;
  /// Groups of standing people on the sidewalks.
  double groups_per_100m = 0.0;
};

/// Shares of parked vehicles; the rest are cars.
struct ParkingPlan {
  double share_motorcycles = 0.06;
  double share_trucks = 0.0, share_buses = 0.0, share_other_vehicles = 0.0;
  /// Share of bays with a bicycle beside them.
  double share_bicycles = 0.08;
};

/// Contents of the blocks between the streets.
struct BlockPlan {
  double setback_min_m = 2.0, setback_max_m = 5.0;
  double gap_min_m = 0.0, gap_max_m = 7.0;
  int floors_min = 2, floors_max = 4;
  double trees_per_100m = 5.0;
  double garden_trees_per_100m = 6.0;
  /// Share of lots behind a fence, behind a hedge, behind a wall; the rest is open.
  double share_fence = 0.35, share_hedge = 0.25, share_wall = 0.15;
  /// The same, behind a thicket; where it is not zero, some woods and open land lie
  /// behind thickets or overgrown banks, too.
  double share_thicket = 0.0;
  /// Share of blocks that are open land, wood, or halls behind yards; the rest have houses.
  double share_open = 0.0, share_wood = 0.0, share_halls = 0.0;
  /// Share of the sides of open land and wood that have a crash barrier.
  double share_barrier = 0.0;
};

/// A city of streets on a grid in flat plan coordinates (u, v) [m]; `GroundShape` bends it into
/// the map frame. All traffic, the ego vehicle included, repeats one closed route of streets.
struct CityPlan {
  std::string name;
  std::vector<StreetPlan> streets_along_v;
  std::vector<StreetPlan> streets_along_u;
  /// Ground beyond the outermost streets [m].
  double margin_m = 60.0;
  /// Corners of the route; each leg lies on a street, turns are at right angles.
  std::vector<Eigen::Vector2d> route;
  /// Radius of the route's centre line in the turns [m].
  double turn_radius_m = 9.0;
  /// Cross-section on the route.
  StreetProfile route_profile;
  /// Pedestrian crossings with lights, on the route's centre line.
  std::vector<Eigen::Vector2d> crossings;
  /// The ego vehicle's start along the route [m], and its lane (0 = next to the middle).
  double ego_start_m = 0.0;
  int ego_lane = 0;
  /// Streets follow sine waves of this amplitude and wave length / 2 pi about the grid [m].
  double bend_m = 6.0;
  double bend_length_m = 55.0;
  /// Hills: amplitude and wave length / 2 pi [m].
  double hill_m = 1.2;
  double hill_length_m = 45.0;
  double kerb_m = 0.13;
  /// Share of house fronts with a driveway, where the kerb is lowered.
  double share_driveways = 0.0;
  /// Share of the yards behind the streets that are paved, in pieces of 14 m.
  double share_paved_yards = 0.0;
  /// Height of the slopes behind the streets, and of the tufts of grass [m].
  double embankment_m = 0.0;
  double tufts_m = 0.0;
  /// White lines between lanes, and along the edge of the driven road.
  bool lane_lines = true, edge_lines = true;
  /// Medians of stone instead of grass.
  bool paved_medians = false;
  std::vector<GroundPatch> patches;
  /// Many shapes of plants, fences, furniture and houses instead of a few plain ones.
  bool many_shapes = false;
  BlockPlan blocks;
  TrafficPlan traffic;
  ParkingPlan parking;

  /// All faults, one a line; empty when the plan is valid.
  [[nodiscard]] std::string faults() const;
  /// Unit vector along the street that a crossing of the route lies on.
  [[nodiscard]] Eigen::Vector2d direction_at(const Eigen::Vector2d& crossing) const;
};

/// Narrow residential streets, many turns, parked cars, little traffic; 900 m round.
[[nodiscard]] CityPlan quiet_city();
/// An avenue of three lanes each way, full of vehicles; 1.7 km round.
[[nodiscard]] CityPlan crowded_avenue();
/// One small block, for tests; 200 m round.
[[nodiscard]] CityPlan test_yard();
/// The plan of that name ("quiet", "crowd", "yard").
/// @throws std::invalid_argument with the names that exist.
[[nodiscard]] CityPlan city_plan(const std::string& name);

/// One side of a street in the direction of its traffic; plan coordinates [m].
struct StreetSide {
  StreetProfile profile;
  Eigen::Vector2d start, along;
  double length_m;

  [[nodiscard]] Eigen::Vector2d at(double along_m, double right_m) const {
    return start + along_m * along + right_m * Eigen::Vector2d(along.y(), -along.x());
  }
  [[nodiscard]] double heading() const { return std::atan2(along.y(), along.x()); }
};

/// Both sides of every street, from margin to margin.
[[nodiscard]] std::vector<StreetSide> street_sides(const CityPlan& plan);

}  // namespace stillmap::simulation
