#pragma once

#include <cmath>
#include <numbers>

#include "tests/server/room_scans.hpp"

namespace stillmap::test {

/// A round in the hall of room_scans, 10 scans a second.
inline constexpr int scans_a_round = 200;

/// True pose of the lidar at scan `index` of a drive round and round.
inline StampedPose round_pose(int index) {
  constexpr double radius_m = 5.0;
  const double angle = 2.0 * std::numbers::pi * index / scans_a_round;
  const Eigen::Vector3d position_map(radius_m * std::cos(angle), radius_m * std::sin(angle), 0.0);
  return {.stamp_ns = 1'700'000'000'000'000'000 + std::int64_t{index} * 100'000'000,
          .T_map_lidar = Eigen::Isometry3d(
              Eigen::Translation3d(position_map) *
              Eigen::AngleAxisd(angle + std::numbers::pi / 2.0, Eigen::Vector3d::UnitZ()))};
}

}  // namespace stillmap::test
