#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "core/simulation/ground.hpp"

namespace stillmap::simulation {

/// A closed path on the ground. Positions are arc lengths in the map frame [m], modulo the length.
class Path {
 public:
  struct Spot {
    Eigen::Vector2d plan;
    /// Direction of travel in plan coordinates [rad].
    double heading_plan;
  };

  /// @param corners_plan a closed polygon, finely sampled in its curves.
  Path(const GroundShape& ground, const std::vector<Eigen::Vector2d>& corners_plan);

  [[nodiscard]] double length_m() const { return length_m_; }
  [[nodiscard]] Spot at(double position_m) const;
  /// Absolute curvature in the map frame [1/m].
  [[nodiscard]] double curvature(double position_m) const;
  /// Position nearest to a spot of the plan.
  [[nodiscard]] double nearest(const Eigen::Vector2d& spot_plan) const;
  /// `position_m` modulo the length: 0 <= result < length.
  [[nodiscard]] double wrapped(double position_m) const;

 private:
  struct Sample {
    Eigen::Vector2d plan, along_plan;
    double curvature;
  };
  std::vector<Sample> samples_;
  double length_m_ = 0.0;
};

/// The city's route, reversed or not, shifted `offset_m` to the right of travel.
/// Turns have the route's radius changed by the offset, or `turn_radius_m` where given.
[[nodiscard]] Path route_path(const GroundShape& ground, bool reversed, double offset_m,
                              std::optional<double> turn_radius_m = std::nullopt);

/// Positions along a path over time, sampled every `step_s`.
class Track {
 public:
  static constexpr double step_s = 0.1;

  explicit Track(double start_s) : start_s_(start_s) {}
  void add(double position_m, double speed_mps) { knots_.push_back({position_m, speed_mps}); }

  /// Cubic Hermite interpolation; constant before the first and after the last knot [m].
  [[nodiscard]] double position_at(double time_s) const;
  [[nodiscard]] double speed_at(double time_s) const;

 private:
  struct Knot {
    double position_m, speed_mps;
  };
  struct Segment {
    std::size_t knot;
    double part;
  };
  [[nodiscard]] Segment segment_at(double time_s) const;

  double start_s_;
  std::vector<Knot> knots_;
};

/// Red for `red_s` at the start of every period.
struct TrafficLight {
  double period_s, red_s, offset_s;
  [[nodiscard]] bool is_red(double time_s) const;
};

/// A traffic light, so far along a lane.
struct StopLine {
  double position_m;
  TrafficLight light;
};

/// Parameters of the intelligent driver model (Treiber, Hennecke and Helbing, 2000).
struct DriverModel {
  double acceleration_mps2 = 1.6;
  double braking_mps2 = 2.2;
  double headway_s = 0.8;
  double standstill_gap_m = 2.2;
  double lateral_acceleration_mps2 = 2.0;
};

/// `start_m` is along the lane.
struct LaneUser {
  double start_m;
  double length_m;
  double desired_speed_mps;
};

struct TimeSpan {
  double from_s, to_s;
};

/// Tracks of all users of one closed lane.
/// @param users in order of their start. They neither overtake nor touch each other.
/// @param stops red lights are obeyed where 4 m/s^2 of braking suffices.
[[nodiscard]] std::vector<Track> drive_lane(const Path& lane, const std::vector<LaneUser>& users,
                                            const std::vector<StopLine>& stops,
                                            const DriverModel& model, TimeSpan span);

}  // namespace stillmap::simulation
