#include "core/simulation/traffic.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

namespace stillmap::simulation {

struct LaneParticipants {
  /// Index in `Traffic::shapes`; none for the ego vehicle, which the lidar does not see.
  std::vector<std::optional<std::size_t>> shapes;
  std::vector<double> lengths_m, desired_speeds_mps;

  void add(std::optional<std::size_t> shape, double length_m, double desired_speed_mps) {
    shapes.push_back(shape);
    lengths_m.push_back(length_m);
    desired_speeds_mps.push_back(desired_speed_mps);
  }
};

namespace {

using Eigen::Vector2d;

constexpr float ego_length_m = 4.6F;
// Simulated before the first scan, until the traffic is in its steady state.
constexpr double warm_up_s = 15.0;
constexpr double stands_below_mps = 0.1;
constexpr double crossing_mps = 1.7;
constexpr DriverModel vehicle_driver{};
constexpr DriverModel walker{.acceleration_mps2 = 1.0,
                             .braking_mps2 = 1.5,
                             .headway_s = 0.4,
                             .standstill_gap_m = 0.6,
                             .lateral_acceleration_mps2 = 1.5};

double wheelbase(ObjectKind kind) {
  switch (kind) {
    case ObjectKind::bus:
      return 5.4;
    case ObjectKind::truck:
      return 5.0;
    case ObjectKind::car:
      return 2.6;
    case ObjectKind::other_vehicle:
      return 2.0;
    default:
      return 1.0;
  }
}

// Start positions once round the lane, with uneven gaps.
std::vector<LaneUser> spread_out(const LaneParticipants& participants, double lane_m,
                                 double first_m, Random& random) {
  const std::vector<double>& lengths = participants.lengths_m;
  const double occupied = std::accumulate(lengths.begin(), lengths.end(), 0.0);
  const double gap = (lane_m - occupied) / static_cast<double>(lengths.size());
  std::vector<LaneUser> users;
  double rear = first_m - 0.5 * lengths.front();
  for (std::size_t i = 0; i < lengths.size(); ++i) {
    const double shift = i == 0 ? 0.0 : 0.35 * gap * random.uniform(-1.0, 1.0);
    users.push_back(
        {rear + 0.5 * lengths[i] + shift, lengths[i], participants.desired_speeds_mps[i]});
    rear += lengths[i] + gap;
  }
  return users;
}

// Across the road and back, 0.4 m beside.
std::vector<Vector2d> there_and_back(const Vector2d& middle, const Vector2d& across,
                                     double half_way_m) {
  const Vector2d side = 0.2 * Vector2d(across.y(), -across.x());
  return {middle - half_way_m * across + side, middle + half_way_m * across + side,
          middle + half_way_m * across - side, middle - half_way_m * across - side};
}

// Waits for red, walks one stage, waits for the next red.
Track cross_at_red(double stage_m, const TrafficLight& light, double delay_s, TimeSpan span) {
  Track track(span.from_s);
  double position = 0.0;
  double goal = 0.0;
  bool was_red = true;
  const auto steps = static_cast<int>(std::ceil((span.to_s - span.from_s) / Track::step_s)) + 1;
  for (int step = 0; step < steps; ++step) {
    const bool red = light.is_red(span.from_s + step * Track::step_s - delay_s);
    if (red && !was_red) goal = position + stage_m;
    was_red = red;
    const double speed = position < goal ? crossing_mps : 0.0;
    track.add(position, speed);
    position = std::min(goal, position + speed * Track::step_s);
  }
  return track;
}

}  // namespace

Traffic::Traffic(const GroundShape& ground, std::uint64_t seed, TimeSpan span,
                 std::uint16_t first_instance)
    : ground_(ground), span_{span.from_s - warm_up_s, span.to_s}, instances_(first_instance) {
  const CityPlan& plan = ground.plan();
  const TrafficPlan& traffic = plan.traffic;
  Random random(seed, 31);
  for (std::size_t i = 0; i < plan.crossings.size(); ++i) {
    lights_.push_back(
        {traffic.light_period_s, traffic.light_red_s, random.uniform(0.0, traffic.light_period_s)});
  }
  add_shapes(random);
  const StreetProfile& profile = plan.route_profile;
  for (const bool reversed : {false, true}) {
    for (int lane = 0; lane < profile.lanes; ++lane) add_vehicle_lane(reversed, lane, random);
    add_slow_lane(ObjectKind::bicyclist, reversed, profile.bike_centre_m(), 5.0,
                  traffic.cyclists_per_km, random);
    // Two walking lanes of opposite direction on each sidewalk.
    const double back = profile.half_street_m();
    const double walk_m = traffic.pedestrians_per_km / 2.0;
    add_slow_lane(ObjectKind::person, reversed, back - 0.6, 1.35, walk_m, random);
    add_slow_lane(ObjectKind::person, !reversed, -(back - 1.5), 1.35, walk_m, random);
  }
  add_crossing_people(random);
}

void Traffic::add_shapes(Random& random) {
  const Variety variety = ground_.plan().many_shapes ? Variety::any : Variety::plain;
  const bool any = variety == Variety::any;
  const std::vector<std::pair<ObjectKind, int>> variants{{ObjectKind::car, 12},
                                                         {ObjectKind::truck, 4},
                                                         {ObjectKind::bus, any ? 2 : 1},
                                                         {ObjectKind::bicyclist, any ? 4 : 1},
                                                         {ObjectKind::person, 8},
                                                         {ObjectKind::motorcyclist, any ? 3 : 0},
                                                         {ObjectKind::other_vehicle, any ? 3 : 0}};
  for (const auto& [kind, count] : variants) {
    for (int i = 0; i < count; ++i) {
      shapes_.push_back(make_object(kind, random.fork(), variety));
    }
  }
}

std::size_t Traffic::random_shape(ObjectKind kind, Random& random) const {
  const auto first = std::ranges::find(shapes_, kind, &ObjectShape::kind);
  const auto count = std::ranges::count(shapes_, kind, &ObjectShape::kind);
  return static_cast<std::size_t>(first - shapes_.begin()) +
         random.index(static_cast<std::size_t>(count));
}

ObjectKind Traffic::random_vehicle(Random& random) const {
  const TrafficPlan& traffic = ground_.plan().traffic;
  double draw = random.uniform();
  const auto falls_to = [&](double share) { return (draw -= share) < 0.0; };
  if (falls_to(traffic.share_trucks)) return ObjectKind::truck;
  if (falls_to(traffic.share_buses)) return ObjectKind::bus;
  if (falls_to(traffic.share_motorcyclists)) return ObjectKind::motorcyclist;
  return falls_to(traffic.share_other_vehicles) ? ObjectKind::other_vehicle : ObjectKind::car;
}

void Traffic::add_mover(std::size_t shape, std::size_t path, Track track, Random& random) {
  movers_.push_back({shape, path, std::move(track), ++instances_, random.between(0.25, 1.5)});
}

std::vector<StopLine> Traffic::stop_lines(const Path& path) const {
  const CityPlan& plan = ground_.plan();
  std::vector<StopLine> stops;
  for (std::size_t i = 0; i < plan.crossings.size(); ++i) {
    stops.push_back({path.nearest(plan.crossings[i]) - 3.6, lights_[i]});
  }
  return stops;
}

LaneParticipants Traffic::vehicle_participants(const Path& lane, std::optional<ObjectKind> escort,
                                               bool with_ego, Random& random) const {
  const TrafficPlan& traffic = ground_.plan().traffic;
  LaneParticipants participants;
  if (with_ego) participants.add(std::nullopt, ego_length_m, traffic.speed_mps);
  if (escort) {
    const std::size_t shape = random_shape(*escort, random);
    participants.add(shape, shapes_[shape].length_m, traffic.speed_mps);
  }
  const auto wanted = static_cast<std::size_t>(traffic.vehicles_per_km * lane.length_m() / 1000.0);
  // The lane must hold all participants with gaps of 3 m.
  double room_m = lane.length_m() - 40.0;
  while (participants.shapes.size() < wanted) {
    const std::size_t shape = random_shape(random_vehicle(random), random);
    room_m -= shapes_[shape].length_m + 3.0;
    if (room_m < 0.0) break;
    const double speed_factor = 1.0 + traffic.speed_spread * random.uniform(-1.0, 1.0);
    participants.add(shape, shapes_[shape].length_m, traffic.speed_mps * speed_factor);
  }
  return participants;
}

Vector2d Traffic::ego_start_plan() const {
  const CityPlan& plan = ground_.plan();
  const double offset = plan.route_profile.lane_centre_m(plan.ego_lane);
  return route_path(ground_, false, offset).at(plan.ego_start_m).plan;
}

void Traffic::add_vehicle_lane(bool reversed, int lane, Random& random) {
  const CityPlan& plan = ground_.plan();
  const bool with_ego = !reversed && lane == plan.ego_lane;
  const bool beside_ego = !reversed && std::abs(lane - plan.ego_lane) == 1;
  std::optional<ObjectKind> escort;
  if (plan.traffic.escorted && beside_ego) {
    escort = lane < plan.ego_lane ? ObjectKind::truck : ObjectKind::bus;
  }
  Path path = route_path(ground_, reversed, plan.route_profile.lane_centre_m(lane));
  const LaneParticipants participants = vehicle_participants(path, escort, with_ego, random);
  double first_m = random.uniform(0.0, path.length_m());
  if (with_ego) first_m = plan.ego_start_m;
  if (escort) first_m = path.nearest(ego_start_plan()) + random.uniform(-4.0, 4.0);
  const std::vector<StopLine> stops = stop_lines(path);
  add_participants(participants, std::move(path), first_m, vehicle_driver, stops, random);
}

void Traffic::add_slow_lane(ObjectKind kind, bool reversed, double offset_m,
                            double desired_speed_mps, double per_km, Random& random) {
  const bool walks = kind == ObjectKind::person;
  Path path = walks ? route_path(ground_, reversed, offset_m, 1.0)
                    : route_path(ground_, reversed, offset_m);
  const auto count = static_cast<std::size_t>(per_km * path.length_m() / 1000.0);
  LaneParticipants participants;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t shape = random_shape(kind, random);
    participants.add(shape, shapes_[shape].length_m,
                     desired_speed_mps * random.uniform(0.85, 1.15));
  }
  const double first_m = random.uniform(0.0, path.length_m());
  const auto stops = walks ? std::vector<StopLine>{} : stop_lines(path);
  add_participants(participants, std::move(path), first_m, walker, stops, random);
}

void Traffic::add_participants(const LaneParticipants& participants, Path lane, double first_m,
                               const DriverModel& driver, const std::vector<StopLine>& stops,
                               Random& random) {
  if (participants.shapes.empty()) return;
  const auto users = spread_out(participants, lane.length_m(), first_m, random);
  std::vector<Track> tracks = drive_lane(lane, users, stops, driver, span_);
  paths_.push_back(std::move(lane));
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (participants.shapes[i]) {
      add_mover(*participants.shapes[i], paths_.size() - 1, std::move(tracks[i]), random);
    } else {
      ego_ = Mover{.path = paths_.size() - 1, .track = std::move(tracks[i])};
    }
  }
}

void Traffic::add_crossing_people(Random& random) {
  const CityPlan& plan = ground_.plan();
  if (plan.crossings.empty()) return;
  const double half_way = plan.route_profile.half_road_m() + 1.1;
  // Where there is a median, people wait there for the next red.
  const double stages = plan.route_profile.half_median_m > 0.8 ? 4.0 : 2.0;
  const auto here = static_cast<std::size_t>(plan.traffic.crossing_pedestrians);
  const std::size_t each = (here + plan.crossings.size() - 1) / plan.crossings.size();
  for (std::size_t i = 0; i < here; ++i) {
    const std::size_t light = i % plan.crossings.size();
    const double slot = static_cast<double>(i / plan.crossings.size()) + 0.5;
    const Vector2d along = plan.direction_at(plan.crossings[light]);
    const double sideways = 3.2 * (slot / static_cast<double>(each) - 0.5);
    const Vector2d across = (random.chance(0.5) ? 1.0 : -1.0) * Vector2d(-along.y(), along.x());
    Path path(ground_, there_and_back(plan.crossings[light] + sideways * along, across, half_way));
    Track track =
        cross_at_red(path.length_m() / stages, lights_[light], random.uniform(0.3, 1.2), span_);
    paths_.push_back(std::move(path));
    add_mover(random_shape(ObjectKind::person, random), paths_.size() - 1, std::move(track),
              random);
  }
}

Body Traffic::body_at(const Mover& mover, double time_s) const {
  const Path::Spot spot = paths_[mover.path].at(mover.track.position_at(time_s));
  const ObjectKind kind = shapes_[mover.shape].kind;
  const bool moving = mover.track.speed_at(time_s) > stands_below_mps;
  return {
      .shape = mover.shape,
      .T_map_body = kind == ObjectKind::person
                        ? ground_.frame_at(spot.plan, spot.heading_plan)
                        : ground_.leaning_frame_at(spot.plan, spot.heading_plan, wheelbase(kind)),
      .label = moving ? moving_label(kind) : standing_label(kind),
      .instance = mover.instance,
      .brightness = mover.brightness};
}

Eigen::Isometry3d Traffic::T_map_ego_at(double time_s) const {
  const Path::Spot spot = paths_[ego_->path].at(ego_->track.position_at(time_s));
  return ground_.leaning_frame_at(spot.plan, spot.heading_plan, wheelbase(ObjectKind::car));
}

double Traffic::ego_speed_at(double time_s) const { return ego_->track.speed_at(time_s); }

}  // namespace stillmap::simulation
