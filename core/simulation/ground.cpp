#include "core/simulation/ground.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "core/simulation/random.hpp"

namespace stillmap::simulation {
namespace {

// Distances from the kerb of a crossing street at which bays and verges, and medians, end.
constexpr double bay_clearance_m = 7.0;
constexpr double median_clearance_m = 4.0;

struct NearestStreet {
  double distance_m = std::numeric_limits<double>::infinity();
  const StreetProfile* profile = nullptr;
};

NearestStreet nearest(const std::vector<StreetPlan>& streets, double position) {
  NearestStreet best;
  for (const StreetPlan& street : streets) {
    const double distance = std::abs(position - street.position_m);
    if (distance < best.distance_m) best = {distance, &street.profile};
  }
  return best;
}

// From the back of the nearest street's sidewalk into the lots.
double behind_street_m(const std::vector<StreetPlan>& streets, double position) {
  const NearestStreet street = nearest(streets, position);
  if (street.profile == nullptr) return street.distance_m;
  return street.distance_m - street.profile->half_street_m();
}

// Zone according to one street; `other` is the nearest street across it.
Zone zone_by(const NearestStreet& street, const NearestStreet& other) {
  if (street.profile == nullptr || street.distance_m > street.profile->half_street_m()) {
    return Zone::lot;
  }
  const StreetProfile& profile = *street.profile;
  const double clear = other.profile == nullptr ? std::numeric_limits<double>::infinity()
                                                : other.distance_m - other.profile->half_road_m();
  if (street.distance_m < profile.half_median_m) {
    return clear > median_clearance_m ? Zone::median : Zone::road;
  }
  if (street.distance_m < profile.half_driven_m()) return Zone::road;
  if (street.distance_m < profile.half_road_m()) {
    if (clear <= bay_clearance_m) return Zone::road;
    return profile.has_bays ? Zone::parking : Zone::kerbside;
  }
  const bool verge = street.distance_m < profile.half_road_m() + profile.verge_m;
  return verge && clear > bay_clearance_m ? Zone::verge : Zone::sidewalk;
}

Zone lot_zone(const std::vector<GroundPatch>& patches, const Eigen::Vector2d& spot_plan) {
  for (const GroundPatch& patch : patches) {
    if (patch.area_plan.contains(spot_plan)) return patch.zone;
  }
  return Zone::lot;
}

// Relative height of the tufts of grass, 0..1, constant in cells of 0.25 m.
double tuft(const Eigen::Vector2d& spot_plan) {
  const auto cell = [](double x) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x * 4.0)));
  };
  return Random(61, cell(spot_plan.x()), cell(spot_plan.y())).uniform();
}

bool is_driven(Zone zone) {
  return zone == Zone::road || zone == Zone::kerbside || zone == Zone::parking;
}

}  // namespace

GroundShape::GroundShape(CityPlan plan, std::uint64_t seed) : plan_(std::move(plan)) {
  Random random(seed, 11);
  for (double& phase : phase_) phase = random.uniform(0.0, 2.0 * std::numbers::pi);
}

Zone GroundShape::zone(const Eigen::Vector2d& spot_plan) const {
  const NearestStreet along_v = nearest(plan_.streets_along_v, spot_plan.x());
  const NearestStreet along_u = nearest(plan_.streets_along_u, spot_plan.y());
  const Zone first = zone_by(along_v, along_u);
  const Zone second = zone_by(along_u, along_v);
  // At junctions road takes precedence, then parking and median, then sidewalk.
  for (const Zone zone : {first, second}) {
    if (zone == Zone::road) return zone;
  }
  for (const Zone zone : {first, second}) {
    if (is_driven(zone) || zone == Zone::median) return zone;
  }
  if (first == Zone::sidewalk || second == Zone::sidewalk) return Zone::sidewalk;
  const Zone zone = first == Zone::lot ? second : first;
  return zone == Zone::lot ? lot_zone(plan_.patches, spot_plan) : zone;
}

bool GroundShape::is_paved_yard(const Eigen::Vector2d& spot_plan) const {
  if (plan_.share_paved_yards == 0.0) return false;
  constexpr double yard_m = 14.0;
  constexpr double depth_m = 12.0;
  const double by_u = behind_street_m(plan_.streets_along_v, spot_plan.x());
  const double by_v = behind_street_m(plan_.streets_along_u, spot_plan.y());
  if (std::min(by_u, by_v) > depth_m) return false;
  const bool beside_u = by_u < by_v;
  const double along = std::floor((beside_u ? spot_plan.y() : spot_plan.x()) / yard_m);
  return Random(64, static_cast<std::uint64_t>(static_cast<std::int64_t>(along)), beside_u ? 1 : 0)
      .chance(plan_.share_paved_yards);
}

double GroundShape::height(const Eigen::Vector2d& spot_plan, Zone zone) const {
  const double u = spot_plan.x();
  const double v = spot_plan.y();
  const double k = 1.0 / plan_.hill_length_m;
  double height = plan_.hill_m * (std::sin(u * k + phase_[0]) + 0.7 * std::sin(v * k + phase_[1]));
  height += 0.015 * std::sin(u / 4.3 + phase_[2]) * std::sin(v / 3.7 + phase_[3]);
  const double off_centre = std::min({nearest(plan_.streets_along_v, u).distance_m,
                                      nearest(plan_.streets_along_u, v).distance_m, 6.0});
  height -= 0.02 * off_centre;
  if (!is_driven(zone)) height += kerb(spot_plan);
  height += embankment(spot_plan);
  const bool is_rough = zone == Zone::verge || zone == Zone::median ||
                        (zone == Zone::lot && !is_paved_yard(spot_plan));
  if (is_rough) height += bump(spot_plan);
  return height;
}

// Slope behind the street, up or down in waves along it.
double GroundShape::embankment(const Eigen::Vector2d& spot_plan) const {
  if (plan_.embankment_m == 0.0) return 0.0;
  const double behind_m = std::min(behind_street_m(plan_.streets_along_v, spot_plan.x()),
                                   behind_street_m(plan_.streets_along_u, spot_plan.y()));
  const double part = std::clamp(behind_m / 7.0, 0.0, 1.0);
  const double wave =
      std::sin(spot_plan.x() / 21.0 + phase_[5]) * std::sin(spot_plan.y() / 17.0 + phase_[6]);
  return plan_.embankment_m * wave * part * part * (3.0 - 2.0 * part);
}

// Height of the kerb, lowered at driveways.
double GroundShape::kerb(const Eigen::Vector2d& spot_plan) const {
  if (plan_.share_driveways == 0.0) return plan_.kerb_m;
  constexpr double pitch_m = 11.0;
  constexpr double driveway_m = 3.75;
  const auto is_driveway = [&](double along, std::uint64_t axis) {
    const double cell = std::floor(along / pitch_m);
    const bool has_driveway =
        Random(62, static_cast<std::uint64_t>(static_cast<std::int64_t>(cell)), axis)
            .chance(plan_.share_driveways);
    return has_driveway && along - cell * pitch_m < driveway_m;
  };
  const NearestStreet by_u = nearest(plan_.streets_along_v, spot_plan.x());
  const NearestStreet by_v = nearest(plan_.streets_along_u, spot_plan.y());
  const auto behind = [](const NearestStreet& street) {
    return street.profile == nullptr ? std::numeric_limits<double>::infinity()
                                     : street.distance_m - street.profile->half_road_m();
  };
  const bool beside_u = behind(by_u) < behind(by_v);
  if (!is_driveway(beside_u ? spot_plan.y() : spot_plan.x(), beside_u ? 1 : 0)) return plan_.kerb_m;
  const double part = std::clamp((beside_u ? behind(by_u) : behind(by_v)) / 1.5, 0.15, 1.0);
  return part * plan_.kerb_m;
}

// Uneven grass, a few centimetres.
double GroundShape::bump(const Eigen::Vector2d& spot_plan) const {
  const double u = spot_plan.x();
  const double v = spot_plan.y();
  return 0.03 * std::sin(u * 1.3 + phase_[4]) * std::sin(v * 1.1 + phase_[5]) +
         0.03 * std::sin(u * 0.41 + v * 0.3 + phase_[6]) +
         (plan_.tufts_m > 0.0 ? plan_.tufts_m * tuft(spot_plan) : 0.0);
}

Eigen::Vector2d GroundShape::to_map(const Eigen::Vector2d& spot_plan) const {
  const double k = 1.0 / plan_.bend_length_m;
  return {spot_plan.x() + plan_.bend_m * std::sin(spot_plan.y() * k + 0.7),
          spot_plan.y() + plan_.bend_m * std::sin(spot_plan.x() * k)};
}

Eigen::Vector3d GroundShape::on_ground(const Eigen::Vector2d& spot_plan) const {
  return on_ground(spot_plan, zone(spot_plan));
}

Eigen::Vector3d GroundShape::on_ground(const Eigen::Vector2d& spot_plan, Zone zone) const {
  const Eigen::Vector2d spot_map = to_map(spot_plan);
  return {spot_map.x(), spot_map.y(), height(spot_plan, zone)};
}

Eigen::Isometry3d GroundShape::frame_at(const Eigen::Vector2d& spot_plan,
                                        double heading_plan) const {
  const Eigen::Vector2d ahead(std::cos(heading_plan), std::sin(heading_plan));
  const Eigen::Vector2d along = to_map(spot_plan + 0.5 * ahead) - to_map(spot_plan - 0.5 * ahead);
  Eigen::Isometry3d T_map_frame(Eigen::Translation3d(on_ground(spot_plan)));
  T_map_frame.rotate(Eigen::AngleAxisd(std::atan2(along.y(), along.x()), Eigen::Vector3d::UnitZ()));
  return T_map_frame;
}

Eigen::Isometry3d GroundShape::leaning_frame_at(const Eigen::Vector2d& spot_plan,
                                                double heading_plan, double wheelbase_m) const {
  const Eigen::Vector2d ahead(std::cos(heading_plan), std::sin(heading_plan));
  const Eigen::Vector2d left(-ahead.y(), ahead.x());
  const Zone here = zone(spot_plan);
  const double half = 0.5 * wheelbase_m;
  const Eigen::Vector3d front = on_ground(spot_plan + half * ahead, here);
  const Eigen::Vector3d rear = on_ground(spot_plan - half * ahead, here);
  const Eigen::Vector3d port = on_ground(spot_plan + 0.7 * left, here);
  const Eigen::Vector3d starboard = on_ground(spot_plan - 0.7 * left, here);
  const Eigen::Vector3d x = (front - rear).normalized();
  const Eigen::Vector3d z = x.cross(port - starboard).normalized();
  Eigen::Isometry3d T_map_frame = Eigen::Isometry3d::Identity();
  T_map_frame.linear() << x, z.cross(x), z;
  T_map_frame.translation() = 0.5 * (front + rear);
  return T_map_frame;
}

}  // namespace stillmap::simulation
