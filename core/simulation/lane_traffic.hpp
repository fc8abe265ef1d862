#pragma once

#include <vector>

#include "core/simulation/path.hpp"

namespace stillmap::simulation {

/// Positions of one mover along its path over time.
class Track {
 public:
  static constexpr double step_s = 0.1;

  explicit Track(double start_s) : start_s_(start_s) {}
  void add(double position_m, double speed_mps) { knots_.push_back({position_m, speed_mps}); }

  /// Smooth (cubic) between the knots; stands before the first and after the last [m].
  [[nodiscard]] double position_at(double time_s) const;
  [[nodiscard]] double speed_at(double time_s) const;

 private:
  struct Knot {
    double position_m, speed_mps;
  };
  struct Place {
    std::size_t knot;
    double part;
  };
  [[nodiscard]] Place place_at(double time_s) const;

  double start_s_;
  std::vector<Knot> knots_;
};

/// A light that is red for `red_s` in every period.
struct TrafficLight {
  double period_s, red_s, offset_s;
  [[nodiscard]] bool is_red(double time_s) const;
};

struct StopLine {
  double position_m;
  TrafficLight light;
};

/// How those on a lane follow each other: the intelligent driver model (Treiber, Hennecke and
/// Helbing, 2000).
struct DriverModel {
  double acceleration_mps2 = 1.6;
  double braking_mps2 = 2.2;
  double headway_s = 0.8;
  double standstill_gap_m = 2.2;
  double lateral_acceleration_mps2 = 2.0;
};

struct LaneUser {
  double start_m;
  double length_m;
  double desired_speed_mps;
};

struct TimeSpan {
  double from_s, to_s;
};

/// Tracks of all users of one closed lane, who are given in order of their start. Nobody overtakes
/// and nobody touches the one ahead; red lights are obeyed where braking is still possible.
[[nodiscard]] std::vector<Track> drive_lane(const Path& lane, const std::vector<LaneUser>& users,
                                            const std::vector<StopLine>& stops,
                                            const DriverModel& model, TimeSpan span);

}  // namespace stillmap::simulation
