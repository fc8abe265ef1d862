#include "core/simulation/city_plan.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace stillmap::simulation {
namespace {

bool is_on(const std::vector<StreetPlan>& streets, double position) {
  for (const StreetPlan& street : streets) {
    if (std::abs(street.position_m - position) < 1e-6) return true;
  }
  return false;
}

std::string street_faults(const std::vector<StreetPlan>& streets, const std::string& field) {
  if (streets.empty()) return field + " is empty; give at least one street\n";
  for (std::size_t i = 1; i < streets.size(); ++i) {
    const double needed =
        streets[i - 1].profile.half_street_m() + streets[i].profile.half_street_m();
    if (!(streets[i].position_m - streets[i - 1].position_m > needed)) {
      return field + ": street " + std::to_string(i) + " must lie more than " +
             std::to_string(needed) + " m behind the one before it\n";
    }
  }
  return "";
}

std::string route_faults(const CityPlan& plan) {
  std::ostringstream out;
  if (plan.route.size() < 4) out << plan.name << ": route needs at least 4 corners\n";
  for (std::size_t i = 0; i < plan.route.size(); ++i) {
    const Eigen::Vector2d& from = plan.route[i];
    const Eigen::Vector2d leg = plan.route[(i + 1) % plan.route.size()] - from;
    const bool along_u = leg.y() == 0.0 && is_on(plan.streets_along_u, from.y());
    const bool along_v = leg.x() == 0.0 && is_on(plan.streets_along_v, from.x());
    if (!along_u && !along_v) out << plan.name << ": route leg " << i << " lies on no street\n";
    if (leg.norm() < 2.0 * plan.turn_radius_m + 5.0) {
      out << plan.name << ": route leg " << i << " is shorter than two turns of turn_radius_m "
          << plan.turn_radius_m << '\n';
    }
  }
  return out.str();
}

std::string traffic_faults(const TrafficPlan& traffic, const std::string& name) {
  std::ostringstream out;
  const auto check = [&](double value, double low, double high, const char* field) {
    if (value >= low && value <= high) return;
    out << name << ": traffic." << field << " is " << value << ", must be " << low << " to " << high
        << '\n';
  };
  check(traffic.vehicles_per_km, 0, 80, "vehicles_per_km");
  check(traffic.share_trucks, 0, 1, "share_trucks");
  check(traffic.share_buses, 0, 1 - traffic.share_trucks, "share_buses");
  const double larger = traffic.share_trucks + traffic.share_buses;
  check(traffic.share_motorcyclists, 0, 1 - larger, "share_motorcyclists");
  check(traffic.share_other_vehicles, 0, 1 - larger - traffic.share_motorcyclists,
        "share_other_vehicles");
  check(traffic.groups_per_100m, 0, 50, "groups_per_100m");
  check(traffic.cyclists_per_km, 0, 100, "cyclists_per_km");
  check(traffic.pedestrians_per_km, 0, 200, "pedestrians_per_km");
  check(traffic.crossing_pedestrians, 0, 100, "crossing_pedestrians");
  check(traffic.speed_mps, 1, 30, "speed_mps");
  check(traffic.speed_spread, 0, 0.5, "speed_spread");
  check(traffic.light_period_s, 10, 1000, "light_period_s");
  check(traffic.light_red_s, 0, traffic.light_period_s - 5, "light_red_s");
  check(traffic.parked_per_100m, 0, 15, "parked_per_100m");
  return out.str();
}

StreetProfile avenue() {
  return {.half_median_m = 1.2,
          .lanes = 3,
          .lane_width_m = 3.6,
          .bike_lane_m = 1.6,
          .parking_m = 2.2,
          .verge_m = 2.0,
          .sidewalk_m = 3.2};
}

std::vector<StreetPlan> streets(std::initializer_list<double> positions,
                                const StreetProfile& profile) {
  std::vector<StreetPlan> out;
  for (const double position : positions) out.push_back({position, profile});
  return out;
}

void add_sides(std::vector<StreetSide>& sides, const std::vector<StreetPlan>& streets,
               const std::vector<StreetPlan>& across, double margin, bool along_u) {
  const double low = across.front().position_m - margin;
  const double high = across.back().position_m + margin;
  const Eigen::Vector2d way = along_u ? Eigen::Vector2d(1, 0) : Eigen::Vector2d(0, 1);
  for (const StreetPlan& street : streets) {
    const auto point = [&](double along) {
      return along_u ? Eigen::Vector2d(along, street.position_m)
                     : Eigen::Vector2d(street.position_m, along);
    };
    sides.push_back({street.profile, point(low), way, high - low});
    sides.push_back({street.profile, point(high), -way, high - low});
  }
}

}  // namespace

std::string CityPlan::faults() const {
  std::string out = street_faults(streets_along_v, name + ": streets_along_v") +
                    street_faults(streets_along_u, name + ": streets_along_u") +
                    route_faults(*this) + traffic_faults(traffic, name);
  if (ego_lane < 0 || ego_lane >= route_profile.lanes) {
    out += name + ": ego_lane is " + std::to_string(ego_lane) + ", the route has " +
           std::to_string(route_profile.lanes) + " lanes\n";
  }
  if (!(bend_length_m > 0.0 && std::abs(bend_m) <= 0.3 * bend_length_m)) {
    out += name + ": bend_m must be at most 0.3 bend_length_m\n";
  }
  if (!(hill_length_m > 0.0 && std::abs(hill_m) <= 0.15 * hill_length_m)) {
    out += name + ": hill_m must be at most 0.15 hill_length_m\n";
  }
  const bool rare = traffic.share_motorcyclists + traffic.share_other_vehicles > 0.0 ||
                    parking.share_trucks + parking.share_buses + parking.share_other_vehicles > 0.0;
  if (!many_shapes && (rare || traffic.groups_per_100m > 0.0)) {
    out += name + ": motorcyclists, other vehicles, parked trucks and buses and groups of people " +
           "need many_shapes\n";
  }
  if (turn_radius_m - route_profile.bike_centre_m() < 2.0) {
    out += name + ": turn_radius_m is too small for the width of the route\n";
  }
  return out;
}

Eigen::Vector2d CityPlan::direction_at(const Eigen::Vector2d& crossing) const {
  for (const StreetPlan& street : streets_along_u) {
    if (std::abs(street.position_m - crossing.y()) < 0.1) return {1, 0};
  }
  return {0, 1};
}

CityPlan quiet_city() {
  CityPlan plan;
  plan.name = "quiet";
  plan.streets_along_v = streets({0, 130, 260}, {});
  plan.streets_along_u = streets({0, 95, 190}, {});
  plan.route = {{0, 0}, {260, 0}, {260, 95}, {130, 95}, {130, 190}, {0, 190}};
  plan.crossings = {{90, 0}, {0, 70}};
  plan.ego_start_m = -20.0;
  plan.blocks.setback_min_m = 3.0;
  plan.blocks.setback_max_m = 7.0;
  plan.blocks.garden_trees_per_100m = 11.0;
  plan.traffic.speed_mps = 12.0;
  plan.traffic.light_red_s = 13.0;
  return plan;
}

CityPlan crowded_avenue() {
  CityPlan plan;
  plan.name = "crowd";
  plan.route_profile = avenue();
  plan.streets_along_v = streets({180, 360, 540}, {});
  plan.streets_along_v.insert(plan.streets_along_v.begin(), {0.0, avenue()});
  plan.streets_along_v.push_back({720.0, avenue()});
  plan.streets_along_u = streets({0, 140}, avenue());
  plan.route = {{0, 0}, {720, 0}, {720, 140}, {0, 140}};
  // The largest that the kerbs allow, since long vehicles sweep sideways in turns.
  plan.turn_radius_m = 22.0;
  plan.crossings = {{150, 0}, {450, 0}, {300, 140}};
  plan.ego_start_m = -30.0;
  plan.ego_lane = 1;
  plan.bend_m = 9.0;
  plan.bend_length_m = 80.0;
  plan.hill_m = 1.5;
  plan.hill_length_m = 70.0;
  plan.blocks = {.setback_min_m = 9.0,
                 .setback_max_m = 14.0,
                 .gap_min_m = 0.0,
                 .gap_max_m = 12.0,
                 .floors_min = 3,
                 .floors_max = 6,
                 .trees_per_100m = 9.0,
                 .garden_trees_per_100m = 9.0,
                 .share_fence = 0.4,
                 .share_hedge = 0.35,
                 .share_wall = 0.1};
  plan.traffic = {.vehicles_per_km = 52.0,
                  .share_trucks = 0.2,
                  .share_buses = 0.14,
                  .escorted = true,
                  .cyclists_per_km = 14.0,
                  .pedestrians_per_km = 25.0,
                  .crossing_pedestrians = 14,
                  .speed_mps = 13.0,
                  .speed_spread = 0.08,
                  .light_period_s = 80.0,
                  .light_red_s = 12.0,
                  .parked_per_100m = 8};
  return plan;
}

CityPlan test_yard() {
  CityPlan plan;
  plan.name = "yard";
  plan.streets_along_v = streets({0, 60}, {});
  plan.streets_along_u = streets({0, 60}, {});
  plan.route = {{0, 0}, {60, 0}, {60, 60}, {0, 60}};
  plan.crossings = {{30, 0}};
  plan.margin_m = 40.0;
  plan.bend_m = 2.0;
  plan.hill_m = 0.4;
  plan.traffic.vehicles_per_km = 20.0;
  plan.traffic.pedestrians_per_km = 12.0;
  plan.traffic.cyclists_per_km = 8.0;
  return plan;
}

namespace {

// A network whose route comes back to each of its streets, to three in the other direction, too;
// 1.4 km round. Without vehicles: they would not give way where the route crosses itself.
CityPlan street_circuit() {
  CityPlan plan = quiet_city();
  plan.name = "circuit";
  plan.streets_along_v = streets({0, 110, 220}, {});
  plan.streets_along_u = streets({0, 80}, {});
  plan.route = {{0, 0},  {220, 0},  {220, 80}, {110, 80}, {110, 0},  {0, 0},
                {0, 80}, {110, 80}, {110, 0},  {220, 0},  {220, 80}, {0, 80}};
  plan.crossings = {{55, 0}};
  plan.ego_start_m = 20.0;
  plan.traffic.vehicles_per_km = 0.0;
  plan.traffic.cyclists_per_km = 0.0;
  plan.traffic.crossing_pedestrians = 0;
  return plan;
}

}  // namespace

CityPlan city_plan(const std::string& name) {
  for (CityPlan plan : {quiet_city(), crowded_avenue(), test_yard(), street_circuit()}) {
    if (plan.name == name) return plan;
  }
  throw std::invalid_argument("There is no city plan '" + name +
                              "'; take quiet, crowd, yard or circuit.");
}

std::vector<StreetSide> street_sides(const CityPlan& plan) {
  std::vector<StreetSide> sides;
  add_sides(sides, plan.streets_along_u, plan.streets_along_v, plan.margin_m, true);
  add_sides(sides, plan.streets_along_v, plan.streets_along_u, plan.margin_m, false);
  return sides;
}

}  // namespace stillmap::simulation
