#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// What a robot does where nobody has seen the ground.
enum class UnknownGround : std::uint8_t {
  /// It may not go there; paths over it are refused with the reason `unknown`.
  blocked,
  /// It may, as an explorer does.
  allowed,
};

/// What a robot can drive over.
struct RobotProfile {
  std::string name;
  /// Footprint: a rectangle along the robot's heading [m].
  double length_m = 1.0;
  double width_m = 1.0;
  /// The rectangle's centre lies this far ahead of the point that poses speak of (a car's rear
  /// axle) [m].
  double centre_ahead_m = 0.0;
  /// Tightest curve that it drives [m]; 0 for a robot that turns on the spot.
  double min_turning_radius_m = 0.0;
  /// From the ground to the robot's belly, and to its highest point [m].
  double ground_clearance_m = 0.1;
  double height_m = 1.0;
  /// Highest edge of the ground that it climbs [m].
  double max_step_m = 0.05;
  double max_slope_deg = 15.0;
  /// Largest deviation (RMS) of the ground from a plane within half a metre [m].
  double max_roughness_m = 0.05;
  /// Cost of ground of a class, 0 (wanted) to 1; without a value it must not be entered.
  /// `unlabeled` is ground that nobody classified.
  std::array<std::optional<double>, semantic_class_count> class_cost{};
  /// Added where the ground was not seen but follows from its surroundings, 0 to 1.
  double inferred_cost = 0.1;
  UnknownGround unknown = UnknownGround::blocked;

  /// Radius of the largest circle round the pose inside the footprint [m]: closer to something
  /// lethal, the robot touches it whatever its heading.
  [[nodiscard]] double inscribed_radius_m() const;
  /// Radius of the smallest circle round the pose that holds the footprint [m]: farther from
  /// everything lethal, the robot is free whatever its heading.
  [[nodiscard]] double circumscribed_radius_m() const;
  /// What stands higher than this over the ground is an obstacle [m]: the wheels must get over it
  /// and the belly must pass above it.
  [[nodiscard]] double obstacle_height_m() const;

  /// Every fault in words, one a line; empty when the profile can be used.
  [[nodiscard]] std::string faults() const;

  friend bool operator==(const RobotProfile&, const RobotProfile&) = default;
};

}  // namespace stillmap
