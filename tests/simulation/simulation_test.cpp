#include "core/simulation/simulation.hpp"

#include <gmock/gmock.h>
#include <tbb/global_control.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/lidar/prepare.hpp"

namespace stillmap::simulation {
namespace {

SimulationConfig small(std::uint64_t seed = 1) {
  SimulationConfig config;
  config.plan = test_yard();
  config.seed = seed;
  config.sensor = vlp_16();
  config.scans = 20;
  return config;
}

void expect_same(const SimulatedScan& a, const SimulatedScan& b) {
  EXPECT_EQ(a.scan.points_lidar, b.scan.points_lidar);
  EXPECT_EQ(a.scan.intensity, b.scan.intensity);
  EXPECT_EQ(a.raw_labels, b.raw_labels);
  EXPECT_EQ(a.T_map_lidar.matrix(), b.T_map_lidar.matrix());
}

TEST(Simulation, SameSeedGivesTheSameBitsInAnyOrder) {
  const Simulation first(small());
  const Simulation second(small());
  const SimulatedScan seventh = first.scan(7);
  expect_same(first.scan(3), second.scan(3));
  expect_same(seventh, second.scan(7));
  expect_same(seventh, first.scan(7));
}

TEST(Simulation, SameBitsOnOneThread) {
  const SimulatedScan parallel = Simulation(small()).scan(5);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  expect_same(parallel, Simulation(small()).scan(5));
}

TEST(Simulation, ALidarWithoutRingsIsRefused) {
  SimulationConfig config = small();
  config.sensor.pattern = ScanPattern::irregular;
  EXPECT_THAT(config.faults(), ::testing::HasSubstr("'VLP-16' has no rings"));
}

TEST(Simulation, AnotherSeedIsAnotherCity) {
  const SimulatedScan a = Simulation(small(1)).scan(0);
  const SimulatedScan b = Simulation(small(2)).scan(0);
  EXPECT_NE(a.scan.points_lidar, b.scan.points_lidar);
}

TEST(Simulation, FillsEveryFieldOfAVlp16ScanInOrder) {
  const SimulatedScan out = Simulation(small()).scan(4);
  const Scan& scan = out.scan;
  ASSERT_GT(scan.size(), 12000U);
  ASSERT_LT(scan.size(), 16U * 1800U);
  EXPECT_EQ(out.stamp_ns, 400'000'000);
  EXPECT_EQ(scan.stamp_ns, out.stamp_ns);
  ASSERT_EQ(scan.intensity.size(), scan.size());
  ASSERT_EQ(scan.ring.size(), scan.size());
  ASSERT_EQ(scan.labels.size(), scan.size());
  ASSERT_EQ(out.raw_labels.size(), scan.size());
  EXPECT_TRUE(scan.time_offset_s.empty());
  EXPECT_TRUE(std::ranges::is_sorted(scan.ring));
  EXPECT_EQ(scan.ring.back(), 15);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    EXPECT_GE(scan.intensity[i], 0.0F);
    EXPECT_LE(scan.intensity[i], 1.0F);
    EXPECT_LE(scan.points_lidar[i].norm(), small().sensor.max_range_m);
    EXPECT_EQ(scan.labels[i],
              class_from_semantic_kitti(static_cast<std::uint16_t>(out.raw_labels[i] & 0xFFFFU)));
    EXPECT_NE(scan.labels[i], SemanticClass::unlabeled);
  }
}

TEST(Simulation, AzimuthRisesAnticlockwiseInEachRing) {
  const Scan scan = Simulation(small()).scan(0).scan;
  const auto azimuth = [&](std::size_t i) {
    const double angle = std::atan2(scan.points_lidar[i].y(), scan.points_lidar[i].x());
    return angle < -1e-6 ? angle + 2.0 * std::numbers::pi : angle;
  };
  ASSERT_GT(scan.size(), 1000U);
  for (std::size_t i = 1; i < scan.size(); ++i) {
    if (scan.ring[i] == scan.ring[i - 1]) {
      EXPECT_GT(azimuth(i), azimuth(i - 1));
    }
  }
}

TEST(Simulation, BeamsLieOnTheirElevations) {
  const Scan scan = Simulation(small()).scan(0).scan;
  const SensorModel sensor = vlp_16();
  ASSERT_GT(scan.size(), 1000U);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    const Eigen::Vector3f& p = scan.points_lidar[i];
    EXPECT_NEAR(std::atan2(p.z(), p.head<2>().norm()), sensor.beam_elevation(scan.ring[i]), 1e-4);
  }
}

TEST(Simulation, ElevationsAreMeasuredAsTheSensorSaysItErrs) {
  SimulationConfig config = small();
  const Scan exact = Simulation(config).scan(4).scan;
  config.sensor.elevation_offset = 0.004;
  Scan off = Simulation(config).scan(4).scan;
  ASSERT_EQ(off.size(), exact.size());
  const auto elevation = [](const Eigen::Vector3f& p) {
    return std::atan2(p.z(), p.head<2>().norm());
  };
  EXPECT_NEAR(elevation(exact.points_lidar[99]) - elevation(off.points_lidar[99]), 0.004, 1e-6);
  turn_up(off, config.sensor.elevation_offset);
  for (std::size_t i = 0; i < off.size(); ++i)
    EXPECT_LT((off.points_lidar[i] - exact.points_lidar[i]).norm(), 1e-4F);
}

TEST(Simulation, ARobotThatTurnsStaysUprightWhicheverWayItsLidarLooks) {
  SimulationConfig config = small();
  config.motion = LidarMotion::hard_turns;
  config.scans = 60;
  config.T_base_lidar =
      Eigen::Translation3d(1.2, 0.0, 1.4) * Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY());
  const Simulation simulation(config);
  double turn_rad = 0.0;
  for (double time_s = 0.0; time_s < 5.0; time_s += 0.1) {
    const Eigen::Isometry3d T_map_base =
        simulation.T_map_lidar_at(time_s) * config.T_base_lidar->inverse();
    EXPECT_GT(T_map_base.linear()(2, 2), std::cos(0.05)) << time_s;
    turn_rad =
        std::max(turn_rad, Eigen::AngleAxisd(simulation.T_map_lidar_at(0.0).linear().transpose() *
                                             simulation.T_map_lidar_at(time_s).linear())
                               .angle());
  }
  EXPECT_GT(turn_rad, 0.5);
}

TEST(Simulation, FiringsAndBeamsAreThoseAskedFor) {
  SimulationConfig config = small();
  config.sensor = hdl_64e();
  config.firings = 300;
  const Scan scan = Simulation(config).scan(0).scan;
  EXPECT_LE(scan.size(), 64U * 300U);
  EXPECT_GT(scan.size(), 64U * 300U / 2);
  EXPECT_EQ(scan.ring.back(), 63);
}

TEST(Simulation, DropShareTakesThatShare) {
  SimulationConfig config = small();
  config.noise.drop_share = 0.0;
  const auto all = static_cast<double>(Simulation(config).scan(0).scan.size());
  config.noise.drop_share = 0.3;
  const auto rest = static_cast<double>(Simulation(config).scan(0).scan.size());
  EXPECT_NEAR(rest / all, 0.7, 0.02);
}

std::vector<Eigen::Vector3d> walls_map(const SimulatedScan& out) {
  std::vector<Eigen::Vector3d> walls;
  for (std::size_t i = 0; i < out.scan.size(); ++i) {
    if (out.scan.labels[i] != SemanticClass::building) continue;
    walls.emplace_back(out.T_map_lidar * out.scan.points_lidar[i].cast<double>());
  }
  return walls;
}

// Distance to the plane through the eight nearest points.
double plane_distance_m(std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& spot) {
  constexpr std::ptrdiff_t neighbours = 8;
  std::ranges::nth_element(points, points.begin() + neighbours, {},
                           [&](const Eigen::Vector3d& p) { return (p - spot).squaredNorm(); });
  const Eigen::Map<const Eigen::Matrix3Xd> near(points.front().data(), 3, neighbours);
  const Eigen::Vector3d mean = near.rowwise().mean();
  const Eigen::Matrix3Xd spread = near.colwise() - mean;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread * spread.transpose());
  return std::abs(axes.eigenvectors().col(0).dot(spot - mean));
}

// 67th percentile of the distances of the rolling scan's wall points to the walls of the deskewed
// one. Each point is transformed to the map with `T_map_lidar_of` its time.
template <class Pose>
double wall_distance_m(const SimulatedScan& turned, const SimulatedScan& still,
                       Pose T_map_lidar_of) {
  std::vector<Eigen::Vector3d> walls = walls_map(still);
  std::vector<double> distances;
  for (std::size_t i = 0; i < turned.scan.size(); i += 7) {
    if (turned.scan.labels[i] != SemanticClass::building) continue;
    distances.push_back(plane_distance_m(walls, T_map_lidar_of(turned.scan.time_offset_s[i]) *
                                                    turned.scan.points_lidar[i].cast<double>()));
  }
  EXPECT_GT(distances.size(), 100U);
  std::ranges::sort(distances);
  return distances[distances.size() * 2 / 3];
}

TEST(Simulation, RollingScanUndoneWithTheTrueMotionIsTheDeskewedWorld) {
  SimulationConfig config = small();
  config.sensor = hdl_64e();
  config.firings = 1000;
  config.noise = {.range_sigma_m = 0, .drop_share = 0, .intensity_sigma = 0, .min_return = 0};
  const SimulatedScan still = Simulation(config).scan(10);
  config.rolling = true;
  const Simulation rolling(config);
  const SimulatedScan turned = rolling.scan(10);
  ASSERT_EQ(turned.scan.time_offset_s.size(), turned.scan.size());
  ASSERT_GT((rolling.T_map_lidar_at(1.1).translation() - turned.T_map_lidar.translation()).norm(),
            0.2)
      << "the test needs motion";
  const double undone_m = wall_distance_m(
      turned, still, [&](double offset_s) { return rolling.T_map_lidar_at(1.0 + offset_s); });
  const double raw_m = wall_distance_m(turned, still, [&](double) { return turned.T_map_lidar; });
  EXPECT_LT(undone_m, 0.05);
  EXPECT_LT(undone_m, 0.5 * raw_m);
}

TEST(Simulation, TimesRunThroughTheRevolution) {
  SimulationConfig config = small();
  config.rolling = true;
  const Scan scan = Simulation(config).scan(2).scan;
  const auto [first, last] = std::ranges::minmax(scan.time_offset_s);
  EXPECT_LT(first, 0.001F);
  EXPECT_GT(last, 0.098F);
  EXPECT_LT(last, 0.1F);
}

TEST(Simulation, RejectsABadConfigurationWithAllFaults) {
  SimulationConfig config = small();
  config.scans = 0;
  config.lidar_height_m = -2.0;
  config.noise.drop_share = 3.0;
  config.plan.ego_lane = 9;
  config.sensor.rings = 0;
  try {
    const Simulation simulation(config);
    FAIL();
  } catch (const std::invalid_argument& error) {
    for (const char* field : {"scans", "lidar_height_m", "drop_share", "ego_lane", "rings"}) {
      EXPECT_THAT(error.what(), testing::HasSubstr(field));
    }
  }
}

}  // namespace
}  // namespace stillmap::simulation
