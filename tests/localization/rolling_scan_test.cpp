#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "core/lidar/angle_units.hpp"
#include "core/lidar/prepare.hpp"
#include "core/lidar/rings.hpp"
#include "core/localization/lone_scan.hpp"
#include "core/localization/scan_follower.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/localization/yard_map.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

constexpr double yard_period_s = 0.1;

/// Drives in the mapped yard on another day, whose points are measured one after the other: by a
/// vehicle, at up to 10 m/s, and with turns of 55 degrees a second and more.
simulation::SimulationConfig rolling_yard(bool is_fast) {
  simulation::SimulationConfig config = yard(1, 1);
  config.rolling = true;
  if (is_fast) config.plan.traffic.speed_mps = 13.0;
  if (is_fast) config.motion = simulation::LidarMotion::hard_turns;
  return config;
}

struct PoseError {
  double metres = 0.0;
  double degrees = 0.0;
};

class RollingScan : public testing::TestWithParam<bool> {
 protected:
  [[nodiscard]] Scan read(int k) const {
    Scan scan = simulation_.scan(k).scan;
    scan.ring = assign_rings(scan, simulation_.config().sensor);
    return drop_unusable_points(std::move(scan), PrepareConfig{});
  }
  [[nodiscard]] ScanFollower follower() const {
    return {OdometryConfig{}, simulation_.config().sensor,
            [this](std::size_t index) -> std::optional<Scan> {
              if (index == unreadable_) return std::nullopt;
              return read(static_cast<int>(index));
            }};
  }
  [[nodiscard]] LocalizationResult localize(const Scan& scan) const {
    return localizer_.localize(scan, labels_of(scan));
  }
  [[nodiscard]] StampedLocalization localize_alone(const Scan& scan) const {
    return localize_lone_scan(localizer_, scan, labels_of(scan), Eigen::Matrix3d::Identity(),
                              yard_period_s);
  }
  /// From where the lidar was at the scan's stamp; nothing where it is not found.
  [[nodiscard]] std::optional<PoseError> error(const LocalizationResult& result, int k) const {
    if (result.status != LocalizationStatus::found) return std::nullopt;
    const Eigen::Isometry3d off =
        simulation_.scan(k).T_map_lidar.inverse() * result.places.front().T_map_lidar;
    return PoseError{off.translation().norm(),
                     deg_per_rad * Eigen::AngleAxisd(off.linear()).angle()};
  }

  simulation::Simulation simulation_{rolling_yard(GetParam())};
  Localizer localizer_{index_of(first_yard())};
  std::size_t unreadable_ = 1'000'000;
};

/// Of those that are found.
struct Errors {
  void add(const std::optional<PoseError>& error) {
    if (!error) return;
    ++found;
    largest = {std::max(largest.metres, error->metres), std::max(largest.degrees, error->degrees)};
  }
  PoseError largest;
  int found = 0;
};

TEST_P(RollingScan, IsFoundWhereItsLidarWasAtItsStamp) {
  Errors as_measured, followed, alone;
  for (int k = 31; k < 239; k += 32 * slowdown) {
    SCOPED_TRACE(k);
    const Scan scan = read(k);
    as_measured.add(error(localize(scan), k));
    const auto at_stamp = follower().at_stamp(static_cast<std::size_t>(k), scan);
    ASSERT_TRUE(at_stamp);
    followed.add(error(localize(*at_stamp), k));
    const StampedLocalization lone = localize_alone(scan);
    if (lone.motion == SweepMotionSource::map) alone.add(error(lone.result, k));
  }
  EXPECT_GE(followed.found, 7 / slowdown);
  EXPECT_LT(followed.largest.metres, 0.2);
  EXPECT_LT(followed.largest.degrees, 0.7);
  EXPECT_GE(alone.found, 6 / slowdown);
  EXPECT_LT(alone.largest.metres, 0.2);
  EXPECT_LT(alone.largest.degrees, 0.7);
  if (slowdown == 1) {
    EXPECT_GT(as_measured.largest.metres, 0.4) << "else this shows nothing";
  }
}

TEST_P(RollingScan, IsFollowedFromOneThatCanBeReadOn) {
  const Scan scan = read(40);
  unreadable_ = 39;
  EXPECT_FALSE(follower().at_stamp(40, scan)) << "nothing beside it tells its motion";
  unreadable_ = 36;
  EXPECT_TRUE(follower().at_stamp(40, scan));
  EXPECT_FALSE(follower().at_stamp(1, read(1))) << "one scan before it is not enough";
  Scan later = scan;
  later.stamp_ns += 3'000'000'000;
  EXPECT_FALSE(follower().at_stamp(40, later));
  Scan without_times = scan;
  without_times.time_offset_s.clear();
  EXPECT_FALSE(follower().at_stamp(40, without_times));
  EXPECT_EQ(localize_alone(without_times).motion, SweepMotionSource::no_times);
}

TEST_P(RollingScan, GoesOnFromTheScanBefore) {
  ScanFollower one_after_the_other = follower();
  for (int k = 50; k < 54; ++k) {
    const auto index = static_cast<std::size_t>(k);
    const auto at_stamp = one_after_the_other.at_stamp(index, read(k));
    ASSERT_TRUE(at_stamp) << k;
    EXPECT_TRUE(at_stamp->time_offset_s.empty());
    unreadable_ = index - 1;  // it needs none of them again
  }
}

/// Whose motion the map cannot tell: it is not of this city.
TEST_P(RollingScan, OfAnotherCityHasNoMotion) {
  simulation::SimulationConfig config = rolling_yard(GetParam());
  config.seed = 2;
  Scan scan = simulation::Simulation(config).scan(95).scan;
  const StampedLocalization lone = localize_alone(scan);
  EXPECT_EQ(lone.motion, SweepMotionSource::unknown);
  EXPECT_NE(lone.result.status, LocalizationStatus::found);
}

INSTANTIATE_TEST_SUITE_P(Drives, RollingScan, testing::Bool(), [](const auto& drive) {
  return std::string(drive.param ? "fast" : "vehicle");
});

}  // namespace
}  // namespace stillmap::test
