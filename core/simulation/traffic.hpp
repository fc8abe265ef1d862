#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "core/simulation/city.hpp"
#include "core/simulation/lane_traffic.hpp"

namespace stillmap::simulation {

/// A moving object on its path.
struct Mover {
  /// Indices in `Traffic::shapes` and `Traffic::paths`.
  std::size_t shape = 0;
  std::size_t path = 0;
  Track track;
  std::uint16_t instance = 0;
  float brightness = 1.0F;
};

/// The users of one lane, in order of their start.
struct LaneParticipants;

/// Everything that moves in the city, and the ego vehicle, over a span of time. Times count from
/// the first scan [s].
class Traffic {
 public:
  /// @param first_instance instance ids above it are free.
  Traffic(const GroundShape& ground, std::uint64_t seed, TimeSpan span,
          std::uint16_t first_instance);

  [[nodiscard]] const std::vector<ObjectShape>& shapes() const { return shapes_; }
  [[nodiscard]] const std::vector<Mover>& movers() const { return movers_; }
  /// The mover at that time; `shape` is an index in `shapes()`. Above 0.1 m/s its label is a moving
  /// one (252..259).
  [[nodiscard]] Body body_at(const Mover& mover, double time_s) const;
  /// The ego vehicle's frame on the ground, below its lidar.
  [[nodiscard]] Eigen::Isometry3d T_map_ego_at(double time_s) const;
  [[nodiscard]] double ego_speed_at(double time_s) const;

 private:
  void add_shapes(Random& random);
  void add_vehicle_lane(bool reversed, int lane, Random& random);
  [[nodiscard]] LaneParticipants vehicle_participants(const Path& lane,
                                                      std::optional<ObjectKind> escort,
                                                      bool with_ego, Random& random) const;
  [[nodiscard]] Eigen::Vector2d ego_start_plan() const;
  void add_slow_lane(ObjectKind kind, bool reversed, double offset_m, double desired_speed_mps,
                     double per_km, Random& random);
  void add_crossing_people(Random& random);
  [[nodiscard]] std::vector<StopLine> stop_lines(const Path& path) const;
  [[nodiscard]] std::size_t random_shape(ObjectKind kind, Random& random) const;
  [[nodiscard]] ObjectKind random_vehicle(Random& random) const;
  void add_mover(std::size_t shape, std::size_t path, Track track, Random& random);
  void add_participants(const LaneParticipants& participants, Path lane, double first_m,
                        const DriverModel& driver, const std::vector<StopLine>& stops,
                        Random& random);

  const GroundShape& ground_;
  TimeSpan span_;
  std::uint16_t instances_;
  std::vector<TrafficLight> lights_;
  std::vector<ObjectShape> shapes_;
  std::vector<Path> paths_;
  std::vector<Mover> movers_;
  std::optional<Mover> ego_;
};

}  // namespace stillmap::simulation
