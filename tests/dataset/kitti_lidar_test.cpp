#include "core/dataset/kitti_lidar.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "core/lidar/prepare.hpp"
#include "tests/dataset/kitti_lidar_scan.hpp"

namespace stillmap {
namespace {

using test::draw;
using test::Drawing;
using test::per_degree;

std::optional<KittiLidar> recognised(const Drawing& drawing) {
  const Scan scan = draw(drawing);
  return recognise_kitti_lidar(std::span(&scan, 1), 0.1, false);
}

TEST(KittiLidar, IsRecognisedRollingAsInKittiRaw) {
  const auto lidar = recognised({});
  ASSERT_TRUE(lidar);
  EXPECT_DOUBLE_EQ(lidar->sweep_duration_s, 0.1);
}

TEST(KittiLidar, IsRecognisedCompensatedAsInKittiOdometry) {
  for (const double way_m : {0.15, 0.5, 1.5}) {
    const auto lidar = recognised({.way_m = way_m});
    ASSERT_TRUE(lidar) << way_m;
    EXPECT_EQ(lidar->sweep_duration_s, 0.0) << way_m;
  }
}

TEST(KittiLidar, IsNotSeenInOtherLidars) {
  EXPECT_FALSE(recognised({.is_uneven = false}));
  // Its beams, but turned by a simulator.
  EXPECT_FALSE(recognised({.azimuth_noise_deg = 0.0}));
  EXPECT_FALSE(recognise_kitti_lidar({}, 0.1, false));
  const Scan empty;
  EXPECT_FALSE(recognise_kitti_lidar(std::span(&empty, 1), 0.1, false));
  Scan shuffled = draw({});
  std::mt19937 random(3);
  std::ranges::shuffle(shuffled.points_lidar, random);
  EXPECT_FALSE(recognise_kitti_lidar(std::span(&shuffled, 1), 0.1, false));
}

/// As a replay of KITTI odometry is recorded: without times and rings.
TEST(KittiLidar, IsNotCorrectedTwice) {
  Scan scan = draw({.way_m = 0.5});
  // Its lower beams look down by 15.92 degrees in the mean.
  turn_up(scan, 0.66 * per_degree);
  const auto lidar = recognise_kitti_lidar(std::span(&scan, 1), 0.1, true);
  ASSERT_TRUE(lidar);
  lidar->correct(scan);
  EXPECT_FALSE(recognise_kitti_lidar(std::span(&scan, 1), 0.1, true));
}

TEST(AzimuthSteps, TellTheWayThatWasCompensatedFor) {
  for (const double way_m : {0.0, 0.3, 1.0, -0.5}) {
    const auto steps = azimuth_steps(draw({.way_m = way_m}));
    ASSERT_TRUE(steps);
    EXPECT_NEAR(steps->compensated_m, way_m, 0.03 + 0.05 * std::abs(way_m));
  }
}

TEST(AzimuthSteps, NeedJumpsInRange) {
  Scan wall;
  for (int i = 0; i < 2000; ++i) {
    const double a = i * 0.18 * per_degree;
    wall.points_lidar.emplace_back(10.0 * std::cos(a), 10.0 * std::sin(a), 0.0);
  }
  EXPECT_FALSE(azimuth_steps(wall));
}

TEST(KittiLidar, TurnsPointsUpAndGivesThemTimes) {
  Scan scan = draw({});
  scan.points_lidar.emplace_back(0.0F, 0.0F, 0.0F);
  const Scan before = scan;
  KittiLidar{.sweep_duration_s = 0.1}.correct(scan);
  ASSERT_EQ(scan.time_offset_s.size(), scan.size());
  for (std::size_t i = 0; i + 1 < scan.size(); i += 997) {
    const Eigen::Vector3f &p = scan.points_lidar[i], &q = before.points_lidar[i];
    EXPECT_NEAR(p.norm(), q.norm(), 1e-4);
    EXPECT_NEAR(std::atan2(p.y(), p.x()), std::atan2(q.y(), q.x()), 1e-5);
    const auto elevation = [](const Eigen::Vector3f& v) {
      return std::atan2(v.z(), v.head<2>().norm());
    };
    EXPECT_NEAR(elevation(p) - elevation(q), 0.205 * per_degree, 1e-5);
    EXPECT_NEAR(scan.time_offset_s[i], -0.1 * std::atan2(p.y(), p.x()) / (2.0 * std::numbers::pi),
                1e-6);
  }
}

TEST(KittiLidar, SaysWhatItDoes) {
  EXPECT_NE(KittiLidar{.sweep_duration_s = 0.1}.in_words().find("timed"), std::string::npos);
  EXPECT_EQ(KittiLidar{}.in_words().find("timed"), std::string::npos);
}

TEST(KittiLidar, LeavesCompensatedScansWithoutTimes) {
  Scan scan = draw({});
  KittiLidar{}.correct(scan);
  EXPECT_TRUE(scan.time_offset_s.empty());
}

}  // namespace
}  // namespace stillmap
