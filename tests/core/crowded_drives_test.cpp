#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap {
namespace {

using simulation::Simulation;
using simulation::SimulationConfig;

/// A street where nearly all that is near keeps the lidar's pace or comes towards it.
SimulationConfig crowded_street() {
  SimulationConfig config;
  config.plan = simulation::crowded_avenue();
  config.seed = 101;
  config.sensor = vlp_16();
  config.scans = 8;
  return config;
}

/// A drive that meets dense traffic, and where it shall begin.
SimulationConfig dense_traffic(int scans) {
  SimulationConfig config = crowded_street();
  config.seed = 4;
  config.scans = scans;
  return config;
}
constexpr int before_dense_traffic = 225;

Mapper mapper_with_labels(const SensorModel& sensor) {
  MapperConfig config;
  config.sensor = sensor;
  return {config, std::make_unique<PassthroughSegmenter>()};
}

/// The motion to scan k from the one before, in truth.
Eigen::Isometry3d true_motion(const Simulation& simulation, int k) {
  const double period_s = simulation.config().sensor.period_s;
  return simulation.T_map_lidar_at((k - 1) * period_s).inverse() *
         simulation.T_map_lidar_at(k * period_s);
}

class WeightingOfCrowdedDrives : public ::testing::TestWithParam<Weighting> {};

TEST_P(WeightingOfCrowdedDrives, FindTheFirstMotionOfASparseLidar) {
  const Simulation simulation(crowded_street());
  MapperConfig config;
  config.sensor = simulation.config().sensor;
  config.odometry.weighting = GetParam();
  Mapper mapper(config, std::make_unique<PassthroughSegmenter>());
  Eigen::Isometry3d T_map_last = Eigen::Isometry3d::Identity();
  for (int k = 0; k < simulation.config().scans; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    const Eigen::Isometry3d T_map_lidar = mapped->odometry.T_map_lidar;
    if (k > 0) {
      const Eigen::Isometry3d off =
          true_motion(simulation, k).inverse() * (T_map_last.inverse() * T_map_lidar);
      EXPECT_LT(off.translation().norm(), 0.2) << "scan " << k;
    }
    T_map_last = T_map_lidar;
  }
}

/// Traffic hides for seconds nearly all that 16 rings know: a lidar that is called lost there adds
/// nothing to its local map, knows less with every scan, and is lost for good.
TEST(CrowdedDrives, FollowASparseLidarThroughDenseTraffic) {
  const SimulationConfig config = dense_traffic(320);
  const Simulation simulation(config);
  Mapper mapper = mapper_with_labels(config.sensor);
  std::optional<Eigen::Isometry3d> T_map_last;
  int lost = 0;
  for (int k = before_dense_traffic; k < config.scans; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    const bool is_lost = mapped->odometry.health == OdometryHealth::lost;
    const Eigen::Isometry3d T_map_lidar = mapped->odometry.T_map_lidar;
    if (!is_lost && T_map_last) {
      const Eigen::Isometry3d off =
          true_motion(simulation, k).inverse() * (T_map_last->inverse() * T_map_lidar);
      EXPECT_LT(off.translation().norm(), 0.7) << "scan " << k;
    }
    lost += is_lost ? 1 : 0;
    T_map_last = is_lost ? std::nullopt : std::optional(T_map_lidar);
  }
  EXPECT_LE(lost, 3);
}

/// Without labels the edges and planes of 16 rings are those of vehicles, and lead astray by
/// metres.
TEST(CrowdedDrives, FollowASparseLidarThroughDenseTrafficWithoutLabels) {
  const SimulationConfig config = dense_traffic(330);
  const Simulation simulation(config);
  MapperConfig unlabelled;
  unlabelled.sensor = config.sensor;
  Mapper mapper(unlabelled, std::make_unique<NullSegmenter>());
  Eigen::Isometry3d T_map_last = Eigen::Isometry3d::Identity();
  constexpr int first = 40;
  for (int k = first; k < config.scans; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    ASSERT_NE(mapped->odometry.health, OdometryHealth::lost) << "scan " << k;
    const Eigen::Isometry3d T_map_lidar = mapped->odometry.T_map_lidar;
    const Eigen::Isometry3d off =
        true_motion(simulation, k).inverse() * (T_map_last.inverse() * T_map_lidar);
    if (k > first) {
      EXPECT_LT(off.translation().norm(), 0.25) << "scan " << k;
    }
    T_map_last = T_map_lidar;
  }
}

/// Voxels of a map within 15 m of a place.
std::size_t voxels_near(const MapSnapshot& view, const Eigen::Vector3d& position_map) {
  std::size_t count = 0;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels)
      count += (voxel.mean_map.cast<double>() - position_map).norm() < 15.0 ? 1 : 0;
  }
  return count;
}

/// For dozens of scans nothing confirms the place, to who asks for much, then a hundred metres of
/// motion that was seen do.
TEST(CrowdedDrives, MapWhatWasSeenWhileThePlaceWasInDoubt) {
  SimulationConfig config = crowded_street();
  config.seed = 502;
  config.scans = 450;
  config.rolling = true;
  constexpr int before_doubt = 30;
  const Simulation simulation(config);
  MapperConfig doubtful;
  doubtful.sensor = config.sensor;
  doubtful.odometry.registration.min_observability = 0.025;
  Mapper mapper(doubtful, std::make_unique<PassthroughSegmenter>());
  std::vector<Eigen::Vector3d> waiting_map;
  std::size_t entered = 0;
  for (int k = before_doubt; k < config.scans && entered < 20; ++k) {
    const auto mapped = mapper.process(simulation.scan(k).scan);
    ASSERT_TRUE(mapped);
    const OdometryResult& odometry = mapped->odometry;
    entered = mapped->entered_before;
    if (odometry.map_entry == MapEntry::waits) {
      waiting_map.push_back(odometry.T_map_lidar.translation());
    } else if (odometry.map_entry != MapEntry::stays_out && entered < 20) {
      waiting_map.clear();
    }
  }
  ASSERT_GE(entered, 20U);
  ASSERT_GE(waiting_map.size(), entered);
  const auto view = mapper.map_snapshot();
  for (const Eigen::Vector3d& position_map : waiting_map)
    EXPECT_GT(voxels_near(*view, position_map), 200U) << position_map.transpose();
}

/// What the odometry errs by from the first of these scans to the last, where it knows of the rings
/// or nothing tells them.
Eigen::Isometry3d error_over(SimulationConfig config, int first, int scans,
                             ScanPattern pattern = ScanPattern::rings) {
  config.scans = first + scans;
  const Simulation simulation(config);
  SensorModel sensor = config.sensor;
  sensor.pattern = pattern;
  Mapper mapper = mapper_with_labels(sensor);
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  for (int k = first; k < config.scans; ++k) {
    Scan scan = simulation.scan(k).scan;
    if (pattern == ScanPattern::irregular) scan.ring.clear();
    const auto mapped = mapper.process(std::move(scan));
    if (mapped) T_map_lidar = mapped->odometry.T_map_lidar;
  }
  const double period_s = config.sensor.period_s;
  const Eigen::Isometry3d truth = simulation.T_map_lidar_at(first * period_s).inverse() *
                                  simulation.T_map_lidar_at((config.scans - 1) * period_s);
  return truth.inverse() * T_map_lidar;
}

double angle_deg(const Eigen::Isometry3d& T) {
  return Eigen::AngleAxisd(T.linear()).angle() * 180.0 / M_PI;
}

/// The rings' lines on walls come nearer with the lidar, and would take its pitch along.
TEST(CrowdedDrives, KeepASparseLidarLevel) {
  SimulationConfig config = crowded_street();
  config.seed = 4;
  const Eigen::Isometry3d off = error_over(config, 1780, 40);
  EXPECT_LT(angle_deg(off), 0.6);
  EXPECT_LT(off.translation().norm(), 0.15);
}

/// What few rings take for a tilt within the sweep must not add up from scan to scan.
TEST(CrowdedDrives, KeepARollingSparseLidarLevel) {
  SimulationConfig config = crowded_street();
  config.seed = 29;
  config.sensor = hdl_32e();
  config.rolling = true;
  const Eigen::Isometry3d off = error_over(config, 80, 100);
  EXPECT_LT(angle_deg(off), 0.6);
  EXPECT_LT(off.translation().norm(), 0.4);
}

/// The nearest points of a young map lie along one sweep of a beam, which says nothing of a tilt
/// across it.
TEST(CrowdedDrives, BeginLevelWhateverTheLidar) {
  SimulationConfig config = crowded_street();
  config.seed = 604;
  config.sensor.rings = 64;
  config.sensor.fov_up = 22.5 * M_PI / 180.0;
  config.sensor.fov_down = -22.5 * M_PI / 180.0;
  config.sensor.beam_elevations.clear();
  config.sensor.columns = 1024;
  const double off_deg = angle_deg(error_over(config, 0, 25));
  RecordProperty("off_deg", std::to_string(off_deg));
  EXPECT_LT(off_deg, 0.03);
  config.seed = 601;
  config.sensor = hdl_32e();
  const double irregular_off_deg = angle_deg(error_over(config, 0, 25, ScanPattern::irregular));
  RecordProperty("irregular_off_deg", std::to_string(irregular_off_deg));
  EXPECT_LT(irregular_off_deg, 0.3);
}

/// Two bent first scans agree on half of the way, too, where traffic drives along.
TEST(CrowdedDrives, BeginRightWhileScansRoll) {
  for (const std::uint64_t seed : {105, 203, 211}) {
    SimulationConfig config = crowded_street();
    config.seed = seed;
    config.sensor = hdl_64e();
    config.rolling = true;
    EXPECT_LT(error_over(config, 0, 8).translation().norm(), 0.08) << "seed " << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutLabels, WeightingOfCrowdedDrives,
                         ::testing::Values(Weighting::semantic, Weighting::geometric,
                                           Weighting::none));

/// A restart while everything round the lidar drives on with it: rings on the road and vehicles fit
/// where it was last, too, a scan's way too far behind.
TEST(CrowdedDrives, ARestartInTrafficWithoutLabelsFindsWhereItHasDriven) {
  SimulationConfig config = crowded_street();
  config.seed = 61;
  config.scans = 105;
  const Simulation simulation(config);
  MapperConfig unlabelled;
  unlabelled.sensor = config.sensor;
  Mapper maker(unlabelled, std::make_unique<NullSegmenter>());
  constexpr int restart = 100;
  std::optional<MappedScan> mapped;
  for (int k = 0; k < restart; ++k) mapped = maker.process(simulation.scan(k).scan);
  ASSERT_TRUE(mapped);
  Mapper mapper(unlabelled, std::make_unique<NullSegmenter>());
  mapper.resume(*maker.map_snapshot());
  std::optional<Eigen::Isometry3d> T_map_lidar_prior = mapped->odometry.T_map_lidar;
  for (int k = restart; k < config.scans; ++k) {
    mapped = mapper.process(simulation.scan(k).scan, std::exchange(T_map_lidar_prior, {}));
    ASSERT_TRUE(mapped);
    const Eigen::Isometry3d T_map_lidar_true =
        simulation.T_map_lidar_at(0.0).inverse() *
        simulation.T_map_lidar_at(k * config.sensor.period_s);
    const Eigen::Isometry3d off = T_map_lidar_true.inverse() * mapped->odometry.T_map_lidar;
    EXPECT_LT(off.translation().norm(), 0.2) << "scan " << k;
  }
}

/// Scans are missed while the network is made ready for the lidar that was told, and the lidar
/// drives on at 12 m/s: it is not where it was last, in the few voxels that the map has.
TEST(CrowdedDrives, GoOnInMotionWithALidarThatIsToldLate) {
  SimulationConfig config = crowded_street();
  config.seed = 71;
  config.scans = 30;
  const Simulation simulation(config);
  for (const int told : {1, 4, 12}) {
    MapperConfig mapper_config;
    mapper_config.sensor = hdl_64e();
    Mapper mapper(mapper_config, std::make_unique<PassthroughSegmenter>());
    for (int k = 0; k < told; ++k) ASSERT_TRUE(mapper.process(simulation.scan(k).scan));
    mapper_config.sensor = config.sensor;
    mapper.use_sensor(mapper_config, std::make_unique<BlockingSegmenter>(
                                         std::make_unique<PassthroughSegmenter>()));
    constexpr int missed = 3;
    // A map that was begun by a single scan of few rings as by one of many leans.
    const double limit_m = told == 1 ? 0.4 : 0.2;
    for (int k = told + missed; k < config.scans; ++k) {
      const auto mapped = mapper.process(simulation.scan(k).scan);
      ASSERT_TRUE(mapped);
      EXPECT_EQ(mapped->odometry.health, OdometryHealth::good) << "scan " << k;
      const Eigen::Isometry3d T_map_lidar_true =
          simulation.T_map_lidar_at(0.0).inverse() *
          simulation.T_map_lidar_at(k * config.sensor.period_s);
      const Eigen::Isometry3d off = T_map_lidar_true.inverse() * mapped->odometry.T_map_lidar;
      EXPECT_LT(off.translation().norm(), limit_m) << "scan " << k << ", told at " << told;
    }
  }
}

}  // namespace
}  // namespace stillmap
