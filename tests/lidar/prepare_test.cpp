#include "core/lidar/prepare.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace stillmap {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float inf = std::numeric_limits<float>::infinity();

/// Every per-point value carries the point's number, so that misalignment shows.
Scan numbered_scan(std::vector<Eigen::Vector3f> points) {
  Scan scan;
  scan.stamp_ns = 42;
  scan.points_lidar = std::move(points);
  for (std::size_t i = 0; i < scan.size(); ++i) {
    scan.intensity.push_back(static_cast<float>(i) / 100.0F);
    scan.time_offset_s.push_back(static_cast<float>(i));
    scan.ring.push_back(static_cast<std::uint16_t>(i));
    scan.labels.push_back(static_cast<SemanticClass>(i % semantic_class_count));
  }
  return scan;
}

TEST(DropUnusablePoints, KeepsAllValuesOfAPointTogether) {
  const PrepareConfig config{.min_range_m = 1.0, .max_range_m = 50.0, .ego_hull_lidar = {}};
  const Scan kept = drop_unusable_points(numbered_scan({{nan, 0, 0},
                                                        {2, 0, 0},
                                                        {0, inf, 0},
                                                        {0.5, 0, 0},
                                                        {0, 49, 0},
                                                        {0, 0, 51},
                                                        {0, 0, -inf},
                                                        {0, 0, 0},
                                                        {-3, -3, 1}}),
                                         config);
  const std::vector<std::size_t> expected{1, 4, 8};
  ASSERT_EQ(kept.size(), expected.size());
  EXPECT_EQ(kept.stamp_ns, 42);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(kept.ring.at(i), expected[i]);
    EXPECT_FLOAT_EQ(kept.time_offset_s.at(i), static_cast<float>(expected[i]));
    EXPECT_FLOAT_EQ(kept.intensity.at(i), static_cast<float>(expected[i]) / 100.0F);
    EXPECT_EQ(kept.labels.at(i), static_cast<SemanticClass>(expected[i]));
  }
  EXPECT_EQ(kept.points_lidar[2], Eigen::Vector3f(-3, -3, 1));
}

TEST(DropUnusablePoints, LeavesEmptyVectorsEmpty) {
  Scan scan;
  scan.points_lidar = {{5, 0, 0}, {nan, 0, 0}};
  const Scan kept = drop_unusable_points(scan, {});
  EXPECT_EQ(kept.size(), 1U);
  EXPECT_TRUE(kept.intensity.empty() && kept.ring.empty() && kept.time_offset_s.empty() &&
              kept.labels.empty());
  EXPECT_TRUE(drop_unusable_points(Scan{}, {}).empty());
}

TEST(DropUnusablePoints, DropsTheRobotItself) {
  PrepareConfig config;
  config.ego_hull_lidar =
      Eigen::AlignedBox3d(Eigen::Vector3d(-2, -1, -2), Eigen::Vector3d(2, 1, 0.5));
  const Scan kept = drop_unusable_points(
      numbered_scan({{1.5, 0.5, -1}, {1.5, 0.5, 1}, {2.5, 0, 0}, {-1, -0.9F, 0}}), config);
  EXPECT_THAT(kept.ring, testing::ElementsAre(1, 2));
}

TEST(DropUnusablePoints, BringsIntensityInto0To1) {
  Scan scan;
  scan.points_lidar.assign(4, {5, 0, 0});
  scan.intensity = {nan, -0.5F, 0.25F, 7.0F};
  EXPECT_THAT(drop_unusable_points(scan, {}).intensity,
              testing::ElementsAre(0.0F, 0.0F, 0.25F, 1.0F));
}

/// A steady motion: turning `rotation` (a rotation vector) while moving by `velocity`.
struct Twist {
  Eigen::Vector3d rotation, velocity;
};

/// exp(s twist) as the sum of its power series.
Eigen::Isometry3d part_of(const Twist& twist, double s) {
  const Eigen::Vector3d w = s * twist.rotation, v = s * twist.velocity;
  Eigen::Matrix4d generator;
  generator << 0, -w.z(), w.y(), v.x(), w.z(), 0, -w.x(), v.y(), -w.y(), w.x(), 0, v.z(), 0, 0, 0,
      0;
  Eigen::Matrix4d sum = Eigen::Matrix4d::Identity(), term = sum;
  for (int n = 1; n < 60; ++n) {
    term = term * generator / n;
    sum += term;
  }
  return Eigen::Isometry3d(sum);
}

Eigen::Isometry3d pose(double angle, const Eigen::Vector3d& axis, const Eigen::Vector3d& t) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  T.translation() = t;
  return T;
}

TEST(TurnUp, ChangesTheElevationOfEveryPointAlone) {
  constexpr double angle_rad = 0.0036;
  const auto elevation = [](const Eigen::Vector3f& p) {
    return std::atan2(p.z(), std::hypot(p.x(), p.y()));
  };
  const std::vector<Eigen::Vector3f> points{
      {30, 0, -1.7F}, {-3, 4, 0}, {0.5F, -60, 12}, {1, 1, -9}};
  Scan scan = numbered_scan(points);
  turn_up(scan, angle_rad);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3f& p = scan.points_lidar[i];
    EXPECT_NEAR(elevation(p) - elevation(points[i]), angle_rad, 1e-6);
    EXPECT_NEAR(p.norm(), points[i].norm(), 1e-5);
    EXPECT_NEAR(std::atan2(p.y(), p.x()), std::atan2(points[i].y(), points[i].x()), 1e-6);
  }
}

TEST(TurnUp, LeavesPointsThatHaveNoDirection) {
  Scan scan = numbered_scan({{0, 0, 5}, {nan, 1, 1}, {0, 0, 0}});
  turn_up(scan, 0.01);
  EXPECT_EQ(scan.points_lidar[0], Eigen::Vector3f(0, 0, 5));
  EXPECT_TRUE(std::isnan(scan.points_lidar[1].x()));
  EXPECT_EQ(scan.points_lidar[2], Eigen::Vector3f(0, 0, 0));
}

TEST(Deskew, AgreesWithTheMatrixExponential) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (const double angle : {0.0, 1e-12, 1e-7, 1e-3, 0.1, 1.5, 3.0}) {
    const auto vector = [&] { return Eigen::Vector3d(any(random), any(random), any(random)); };
    const Twist twist{angle * vector().normalized(), 3.0 * vector()};
    const Eigen::Isometry3d T_start_end = part_of(twist, 1.0);
    Scan scan;
    std::vector<Eigen::Vector3d> expected;
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d p = 50.0 * vector();
      const double offset_s = 0.1 * any(random);
      scan.points_lidar.push_back(p.cast<float>());
      scan.time_offset_s.push_back(static_cast<float>(offset_s));
      expected.push_back(part_of(twist, offset_s / 0.1) * p);
    }
    const Scan still = deskew(scan, T_start_end, 0.1);
    ASSERT_EQ(still.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      EXPECT_LT((still.points_lidar[i].cast<double>() - expected[i]).norm(), 1e-4)
          << "angle " << angle;
    }
    EXPECT_TRUE(still.time_offset_s.empty());
  }
}

TEST(Deskew, ToTheMiddleMovesManyPointsAsItMovesEach) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (const double angle : {0.0, 1e-7, 1e-3, 0.1, 1.5, 3.1}) {
    const auto vector = [&] { return Eigen::Vector3d(any(random), any(random), any(random)); };
    const Twist twist{angle * vector().normalized(), 3.0 * vector()};
    Scan scan;
    // No multiple of how many are moved at once.
    for (int i = 0; i < 1001; ++i) {
      scan.points_lidar.push_back((50.0 * vector()).cast<float>());
      scan.time_offset_s.push_back(static_cast<float>(0.05 * any(random)));
    }
    const Scan one_by_one = deskew(scan, part_of(twist, 1.0), 0.1);
    deskew_to_middle(scan, {.middle_s = 0.0, .duration_s = 0.1}, part_of(twist, 1.0));
    // Two rounding steps of a coordinate of 64 m.
    constexpr float steps_m = 1.6e-5F;
    for (std::size_t i = 0; i < scan.size(); ++i)
      EXPECT_LE((scan.points_lidar[i] - one_by_one.points_lidar[i]).cwiseAbs().maxCoeff(), steps_m)
          << "angle " << angle;
  }
}

TEST(Deskew, MakesAWallFlatThatATurningLidarSawBent) {
  // The lidar drives 2 m and turns 0.2 rad in a revolution while it looks at the wall x = 20.
  const Twist twist{0.2 * Eigen::Vector3d::UnitZ(), {2.0, 0.1, 0.0}};
  Scan scan;
  for (int i = 0; i <= 100; ++i) {
    const double part = i / 100.0;
    const Eigen::Vector3d p_start(20.0, 10.0 * (part - 0.5), 1.0);
    scan.points_lidar.push_back((part_of(twist, part).inverse() * p_start).cast<float>());
    scan.time_offset_s.push_back(static_cast<float>(0.1 * part));
  }
  EXPECT_GT(std::abs(scan.points_lidar.back().x() - 20.0F), 1.0F);
  const Scan still = deskew(scan, part_of(twist, 1.0), 0.1);
  for (const auto& p : still.points_lidar) EXPECT_NEAR(p.x(), 20.0F, 1e-4F);
}

TEST(Deskew, LeavesAScanWithoutTimesAsItIs) {
  Scan scan;
  scan.points_lidar = {{1, 2, 3}};
  const auto T = pose(0.3, Eigen::Vector3d::UnitX(), {1, 1, 1});
  EXPECT_EQ(deskew(scan, T, 0.1).points_lidar, scan.points_lidar);
}

TEST(Deskew, MovesPointsOfOneTimeAlike) {
  Scan scan;
  scan.points_lidar = {{1, 2, 3}, {4, 5, 6}, {-7, 8, 9}};
  const auto T = pose(0.3, Eigen::Vector3d::UnitZ(), {1, 0, 0});
  scan.time_offset_s.assign(3, 0.0F);
  EXPECT_EQ(deskew(scan, T, 0.1).points_lidar, scan.points_lidar);
  scan.time_offset_s.assign(3, 0.1F);
  const Scan moved = deskew(scan, T, 0.1);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT((moved.points_lidar[i] - T.cast<float>() * scan.points_lidar[i]).norm(), 1e-5F);
  }
}

TEST(Deskew, LeavesPointsOfBrokenClocksWhereTheyAre) {
  Scan scan;
  scan.points_lidar.assign(3, {10, 0, 0});
  scan.time_offset_s = {nan, inf, 1e9F};
  const auto T = pose(0.3, Eigen::Vector3d::UnitZ(), {1, 0, 0});
  EXPECT_EQ(deskew(scan, T, 0.1).points_lidar, scan.points_lidar);
}

TEST(SweepTimes, AreThoseOfTheSweepWhereverTheStampIs) {
  for (const float begin_s : {0.0F, -0.05F, -0.1F, -0.25F, 0.3F, -0.8F}) {
    Scan scan;
    for (int i = 0; i <= 2000; ++i)
      scan.time_offset_s.push_back(begin_s + 0.1F * static_cast<float>(i) / 2000.0F);
    scan.time_offset_s.push_back(nan);
    scan.time_offset_s.push_back(begin_s + 3.0F);
    const SweepTimes sweep = sweep_times(scan, 0.1);
    EXPECT_NEAR(sweep.middle_s, begin_s + 0.05, 1e-6) << begin_s;
    EXPECT_NEAR(sweep.duration_s, 0.1, 1e-6) << begin_s;
    EXPECT_NEAR(sweep.part(begin_s), -0.5, 1e-4) << begin_s;
    EXPECT_EQ(sweep.part(begin_s + 3.0F), 0.0) << begin_s;
  }
  EXPECT_EQ(sweep_times(Scan{}, 0.1).duration_s, 0.0);
}

TEST(UsablePoints, AreThoseOfALookAtEachOfThem) {
  PrepareConfig config;
  config.min_range_m = 1.0;
  config.max_range_m = 30.0;
  config.ego_hull_lidar = {Eigen::Vector3d(-2.0, -1.0, -2.0), Eigen::Vector3d(2.0, 1.0, 0.0)};
  constexpr float nothing = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinite = std::numeric_limits<float>::infinity();
  std::mt19937 random(3);
  std::normal_distribution<float> along(0.0F, 10.0F);
  std::uniform_int_distribution<int> any(0, 19);
  Scan scan;
  for (int i = 0; i < 1000; ++i) {
    const int kind = any(random);
    const float x = kind == 0 ? nothing : kind == 1 ? infinite : along(random);
    const float scale = kind == 2 ? 0.05F : 1.0F;
    scan.points_lidar.push_back(scale * Eigen::Vector3f(x, along(random), along(random)));
  }
  std::vector<std::uint32_t> expected;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    const Eigen::Vector3f& p = scan.points_lidar[i];
    const bool is_ego =
        std::abs(p.x()) <= 2.0F && std::abs(p.y()) <= 1.0F && p.z() >= -2.0F && p.z() <= 0.0F;
    if (p.norm() >= 1.0F && p.norm() <= 30.0F && !is_ego) expected.push_back(i);
  }
  EXPECT_EQ(usable_points(scan, config), expected);
  EXPECT_GT(expected.size(), 500U);
  EXPECT_LT(expected.size(), 950U);
}

TEST(UsablePoints, AreThoseThatAreKept) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Scan scan;
  scan.points_lidar = {{0.1F, 0, 0}, {5, 0, 0}, {nan, 0, 0}, {0, 7, 0}, {500, 0, 0}};
  const std::vector<std::uint32_t> indices = usable_points(scan, PrepareConfig{});
  EXPECT_EQ(indices, (std::vector<std::uint32_t>{1, 3}));
  EXPECT_EQ(drop_unusable_points(scan, PrepareConfig{}).points_lidar,
            (std::vector<Eigen::Vector3f>{{5, 0, 0}, {0, 7, 0}}));
}

}  // namespace
}  // namespace stillmap
