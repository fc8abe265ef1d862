#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap {
namespace {

using simulation::LidarMotion;
using simulation::SimulatedScan;
using simulation::Simulation;
using simulation::SimulationConfig;

SimulationConfig yard(LidarMotion motion, bool rolling, std::uint64_t seed = 5) {
  SimulationConfig config;
  config.plan = simulation::test_yard();
  config.seed = seed;
  config.sensor = hdl_64e();
  config.firings = 900;
  config.scans = 34;
  config.rolling = rolling;
  config.motion = motion;
  return config;
}

Mapper mapper_of(const SimulationConfig& config) {
  MapperConfig mapper;
  mapper.sensor = config.sensor;
  return {mapper, std::make_unique<PassthroughSegmenter>()};
}

/// Poses relative to the first, of a drive whose points' times count from `stamp_part` of the
/// sweep.
std::vector<Eigen::Isometry3d> drive(const SimulationConfig& config, double stamp_part) {
  const Simulation simulation(config);
  Mapper mapper = mapper_of(config);
  const double shift_s = stamp_part * config.sensor.period_s;
  std::vector<Eigen::Isometry3d> poses;
  for (int k = 0; k < config.scans; ++k) {
    Scan scan = simulation.scan(k).scan;
    scan.stamp_ns += std::llround(shift_s * 1e9);
    for (float& offset : scan.time_offset_s) offset -= static_cast<float>(shift_s);
    const auto mapped = mapper.process(std::move(scan));
    if (!mapped || mapped->odometry.health == OdometryHealth::lost) break;
    poses.push_back(mapped->odometry.T_map_lidar);
  }
  return poses;
}

/// Largest error of the motion from scan to scan, from the given scan on [m].
double worst_step_m(const SimulationConfig& config, const std::vector<Eigen::Isometry3d>& poses,
                    double stamp_part, std::size_t from) {
  const Simulation simulation(config);
  const double period_s = config.sensor.period_s;
  const auto truth = [&](std::size_t k) {
    return simulation.T_map_lidar_at((static_cast<double>(k) + stamp_part) * period_s);
  };
  double worst = 0.0;
  for (std::size_t k = from; k < poses.size(); ++k) {
    const Eigen::Isometry3d step = truth(k - 1).inverse() * truth(k);
    const Eigen::Isometry3d found = poses[k - 1].inverse() * poses[k];
    worst = std::max(worst, (step.inverse() * found).translation().norm());
  }
  return worst;
}

/// The same of the rotation [rad], of poses at the start of the sweep.
double worst_turn_rad(const SimulationConfig& config, const std::vector<Eigen::Isometry3d>& poses,
                      std::size_t from) {
  const Simulation simulation(config);
  const auto truth = [&](std::size_t k) {
    return simulation.T_map_lidar_at(static_cast<double>(k) * config.sensor.period_s);
  };
  double worst = 0.0;
  for (std::size_t k = from; k < poses.size(); ++k) {
    const Eigen::Isometry3d step = truth(k - 1).inverse() * truth(k);
    const Eigen::Isometry3d found = poses[k - 1].inverse() * poses[k];
    worst = std::max(worst, Eigen::AngleAxisd((step.inverse() * found).linear()).angle());
  }
  return worst;
}

TEST(HardDrives, TurnsFromOneScanToTheNextAreFollowed) {
  const SimulationConfig config = yard(LidarMotion::hard_turns, false);
  const auto poses = drive(config, 0.0);
  ASSERT_EQ(poses.size(), 34U);
  EXPECT_LE(worst_step_m(config, poses, 0.0, 1), 0.03);
}

TEST(HardDrives, RollingScansAreFollowedWhateverInstantTheStampIs) {
  const SimulationConfig config = yard(LidarMotion::vehicle, true);
  for (const double stamp_part : {0.0, 0.5, 1.0}) {
    const auto poses = drive(config, stamp_part);
    ASSERT_EQ(poses.size(), 34U) << "stamp at " << stamp_part;
    EXPECT_LE(worst_step_m(config, poses, stamp_part, 3), 0.05) << "stamp at " << stamp_part;
  }
}

/// Turns that begin within a sweep: taken for constant, they are off by up to a degree.
TEST(HardDrives, TurnsThatChangeWithinARollingSweepAreFollowed) {
  SimulationConfig config = yard(LidarMotion::hard_turns, true, 110);
  config.plan = simulation::crowded_avenue();
  config.firings = 0;
  config.scans = 24;
  const auto poses = drive(config, 0.0);
  ASSERT_EQ(poses.size(), 24U);
  EXPECT_LE(worst_turn_rad(config, poses, 3), 0.008);
}

TEST(HardDrives, AFirstStampThatIsLateDoesNotBendARollingMap) {
  SimulationConfig config = yard(LidarMotion::vehicle, true);
  config.sensor = vlp_16();
  config.firings = 0;
  config.scans = 16;
  const Simulation simulation(config);
  Mapper mapper = mapper_of(config);
  for (int k = 0; k < config.scans; ++k) {
    Scan scan = simulation.scan(k).scan;
    if (k == 0) scan.stamp_ns += 80'000'000;
    const auto mapped = mapper.process(std::move(scan));
    ASSERT_TRUE(mapped);
    EXPECT_NE(mapped->odometry.health, OdometryHealth::lost) << "scan " << k;
    const Eigen::Isometry3d T_true = simulation.T_map_lidar_at(0.0).inverse() *
                                     simulation.T_map_lidar_at(k * config.sensor.period_s);
    const Eigen::Isometry3d off = T_true.inverse() * mapped->odometry.T_map_lidar;
    EXPECT_LE(off.translation().norm(), 0.2) << "scan " << k;
  }
}

/// Until the new clock is believed it drives farther than a lidar can within a period.
TEST(HardDrives, AClockThatIsSetBackWhileDrivingLosesNothing) {
  SimulationConfig config = yard(LidarMotion::vehicle, false);
  config.scans = 60;
  const Simulation simulation(config);
  Mapper mapper = mapper_of(config);
  const auto T_map_lidar_at = [&](int k) { return simulation.T_map_lidar_at(0.2 * k); };
  EXPECT_GT((T_map_lidar_at(14).inverse() * T_map_lidar_at(24)).translation().norm(), 12.0);
  for (int k = 0; k < 30; ++k) {
    Scan scan = simulation.scan(2 * k).scan;
    if (k >= 15) scan.stamp_ns -= 3'600'000'000'000;
    const auto mapped = mapper.process(std::move(scan));
    EXPECT_EQ(mapped.has_value(), k < 15 || k >= 24) << "scan " << k;
    if (!mapped || k < 15) continue;
    EXPECT_NE(mapped->odometry.health, OdometryHealth::lost) << "scan " << k;
    const Eigen::Isometry3d off =
        (T_map_lidar_at(0).inverse() * T_map_lidar_at(k)).inverse() * mapped->odometry.T_map_lidar;
    EXPECT_LE(off.translation().norm(), 0.1) << "scan " << k;
  }
}

TEST(HardDrives, AMapBegunOnTheWayIsFollowedFromItsFirstRollingScanOn) {
  SimulationConfig config = yard(LidarMotion::hard_turns, true);
  const Simulation simulation(config);
  Mapper mapper = mapper_of(config);
  for (int k = 0; k < 15; ++k) ASSERT_TRUE(mapper.process(simulation.scan(k).scan));
  mapper.reset(2);
  for (int k = 15; k < 20; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    const auto truth = [&](int scan) {
      return simulation.T_map_lidar_at(scan * config.sensor.period_s);
    };
    const Eigen::Isometry3d since_reset = truth(15).inverse() * truth(k);
    const Eigen::Isometry3d off = since_reset.inverse() * mapped->odometry.T_map_lidar;
    EXPECT_LE(off.translation().norm(), 0.02) << "scan " << k;
  }
}

SimulationConfig another_place() {
  SimulationConfig there = yard(LidarMotion::vehicle, false, 6);
  there.plan = simulation::crowded_avenue();
  return there;
}

TEST(HardDrives, ScansOfAnotherPlaceAreLostAndEnterNoMap) {
  const SimulationConfig here = yard(LidarMotion::vehicle, false);
  const Simulation first(here);
  const Simulation second(another_place());
  Mapper mapper = mapper_of(here);
  for (int k = 0; k < 20; ++k) ASSERT_TRUE(mapper.process(first.scan(k).scan));
  const std::uint64_t version = mapper.map_snapshot()->version;
  for (int k = 20; k < 24; ++k) {
    Scan scan = second.scan(k).scan;
    const auto mapped = mapper.process(std::move(scan));
    ASSERT_TRUE(mapped);
    EXPECT_EQ(mapped->odometry.health, OdometryHealth::lost) << "scan " << k;
  }
  EXPECT_EQ(mapper.map_snapshot()->version, version);
  // Back at the first place, it goes on.
  const auto mapped = mapper.process(first.scan(25).scan);
  ASSERT_TRUE(mapped);
  EXPECT_EQ(mapped->odometry.health, OdometryHealth::good);
}

/// What 20 degrees ahead show of a scan.
Scan covered(const Scan& scan) {
  Scan seen;
  seen.stamp_ns = scan.stamp_ns;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const Eigen::Vector3f& p = scan.points_lidar[i];
    if (std::abs(std::atan2(p.y(), p.x())) > 0.175F) continue;
    seen.points_lidar.push_back(p);
    seen.ring.push_back(scan.ring[i]);
    seen.labels.push_back(scan.labels[i]);
  }
  return seen;
}

TEST(HardDrives, ACoveredLidarThatIsCarriedElsewhereIsNotGoodThereAndMapsNothing) {
  const SimulationConfig here = yard(LidarMotion::vehicle, false);
  const Simulation first(here);
  const Simulation second(another_place());
  Mapper mapper = mapper_of(here);
  for (int k = 0; k < 14; ++k) ASSERT_TRUE(mapper.process(first.scan(k).scan));
  const auto health_of = [&mapper](Scan scan) {
    const auto mapped = mapper.process(std::move(scan));
    return mapped ? mapped->odometry.health : OdometryHealth::lost;
  };
  for (int k = 14; k < 17; ++k) static_cast<void>(health_of(covered(first.scan(k).scan)));
  const auto count_voxels = [&mapper] { return mapper.map_snapshot()->tiles.voxel_count(); };
  static_cast<void>(health_of(covered(second.scan(17).scan)));
  const std::size_t voxels = count_voxels();
  // Little tells the two places apart through the gap; all that is seen then does, in the map as
  // it was before.
  for (int k = 18; k < 24; ++k) EXPECT_NE(health_of(second.scan(k).scan), OdometryHealth::good);
  EXPECT_EQ(count_voxels(), voxels);
  // Back at the first place it is found, and believed once it has driven some metres there.
  EXPECT_NE(health_of(first.scan(24).scan), OdometryHealth::lost);
  OdometryHealth last = OdometryHealth::lost;
  for (int k = 25; k < here.scans; ++k) last = health_of(first.scan(k).scan);
  EXPECT_EQ(last, OdometryHealth::good);
}

TEST(HardDrives, ACoveredLidarIsGoodAgainOnceItIsSeenWhereItIs) {
  SimulationConfig config = yard(LidarMotion::vehicle, false);
  const Simulation simulation(config);
  Mapper mapper = mapper_of(config);
  std::optional<OdometryResult> last;
  for (int k = 0; k < 24; ++k) {
    Scan scan = simulation.scan(k).scan;
    if (k >= 12 && k < 20) scan = covered(scan);
    const auto mapped = mapper.process(std::move(scan));
    ASSERT_TRUE(mapped);
    if (mapped->odometry.health == OdometryHealth::good) {
      EXPECT_TRUE(mapped->odometry.is_confirmed());
    }
    last = mapped->odometry;
  }
  EXPECT_EQ(last->health, OdometryHealth::good);
  const Eigen::Isometry3d T_true = simulation.T_map_lidar_at(0.0).inverse() *
                                   simulation.T_map_lidar_at(23 * config.sensor.period_s);
  EXPECT_LT((T_true.translation() - last->T_map_lidar.translation()).norm(), 0.1);
}

TEST(ScanClock, AStampFarAheadMustBeConfirmed) {
  constexpr std::int64_t period_ns = 100'000'000;
  constexpr std::int64_t hour_ns = 3'600'000'000'000;
  ScanClock clock;
  EXPECT_TRUE(clock.accepts(period_ns, 0));
  EXPECT_FALSE(clock.accepts(hour_ns, period_ns));
  // The fault passes.
  EXPECT_TRUE(clock.accepts(3 * period_ns, period_ns));
  // The clock was set: the third scan of the new time is believed.
  EXPECT_FALSE(clock.accepts(hour_ns, 3 * period_ns));
  EXPECT_FALSE(clock.accepts(hour_ns + period_ns, 3 * period_ns));
  EXPECT_TRUE(clock.accepts(hour_ns + 2 * period_ns, 3 * period_ns));
}

TEST(ScanClock, AStampInThePastMustBeConfirmedLonger) {
  constexpr std::int64_t period_ns = 100'000'000;
  constexpr std::int64_t last_ns = 1'000'000'000'000;
  ScanClock clock;
  for (int k = 0; k < 9; ++k) EXPECT_FALSE(clock.accepts(period_ns * (k + 1), last_ns));
  EXPECT_TRUE(clock.accepts(period_ns * 10, last_ns));
  // The same stamp again and again confirms nothing.
  ScanClock stuck;
  for (int k = 0; k < 30; ++k) EXPECT_FALSE(stuck.accepts(period_ns, last_ns));
}

}  // namespace
}  // namespace stillmap
