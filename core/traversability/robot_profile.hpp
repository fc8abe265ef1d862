#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// How a robot treats unknown ground.
enum class UnknownGround : std::uint8_t {
  /// Not traversable; paths over it are in conflict with reason `unknown`.
  blocked,
  /// Traversable, for exploration.
  allowed,
};

/// Footprint and limits of a robot.
struct RobotProfile {
  std::string name;
  /// Footprint: a rectangle along the robot's heading [m].
  double length_m = 1.0;
  double width_m = 1.0;
  /// Distance of the rectangle's centre ahead of the pose's reference point (a car's rear axle)
  /// [m].
  double centre_ahead_m = 0.0;
  /// 0 for a robot that turns on the spot [m].
  double min_turning_radius_m = 0.0;
  /// From the ground to the robot's underside, and to its highest point [m].
  double ground_clearance_m = 0.1;
  double height_m = 1.0;
  /// Highest step of the ground that it climbs [m].
  double max_step_m = 0.05;
  double max_slope_deg = 15.0;
  /// Largest deviation (RMS) of the ground from a plane within half a metre [m].
  double max_roughness_m = 0.05;
  /// Cost of ground of each class, 0 to 1; lethal without a value. `unlabeled` is the cost of
  /// ground without a class.
  std::array<std::optional<double>, semantic_class_count> class_cost{};
  /// Added on inferred ground, 0 to 1.
  double inferred_cost = 0.1;
  UnknownGround unknown = UnknownGround::blocked;

  /// Radius of the largest circle around the pose within the footprint [m]: closer to a lethal
  /// cell, the robot is in collision at any heading.
  [[nodiscard]] double inscribed_radius_m() const;
  /// Radius of the smallest circle around the pose that contains the footprint [m]: farther from
  /// every lethal cell, the robot is free at any heading.
  [[nodiscard]] double circumscribed_radius_m() const;
  /// Objects higher than this above the ground are obstacles [m]: the wheels must climb over them
  /// and the underside must clear them.
  [[nodiscard]] double obstacle_height_m() const;

  /// One line for each invalid value; empty when the profile is valid.
  [[nodiscard]] std::string faults() const;

  friend bool operator==(const RobotProfile&, const RobotProfile&) = default;
};

}  // namespace stillmap
