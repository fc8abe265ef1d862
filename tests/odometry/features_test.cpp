#include "core/odometry/features.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <random>
#include <set>
#include <tuple>

namespace stillmap {
namespace {

using ::testing::IsEmpty;

constexpr double degree = M_PI / 180.0;
constexpr double step = 0.2 * degree;

/// One level ring: `range_m(azimuth)` of what the beam meets; 0 for no return.
Scan ring_scan(double from, double to, const std::function<double(double)>& range_m,
               std::uint16_t ring = 0, float height_m = 0.0F, double step_rad = step) {
  Scan scan;
  const auto shots = static_cast<int>(std::lround((to - from) / step_rad));
  for (int k = 0; k < shots; ++k) {
    const double azimuth = from + (k + 0.5) * step_rad;
    const double range = range_m(azimuth);
    if (range == 0.0) continue;
    scan.points_lidar.emplace_back(static_cast<float>(range * std::cos(azimuth)),
                                   static_cast<float>(range * std::sin(azimuth)), height_m);
    scan.ring.push_back(ring);
  }
  return scan;
}

/// A square room of 16 m with a pillar, in three rings from -180 to 180 degrees.
Scan room_scan() {
  const auto room = [](double azimuth) {
    if (std::abs(azimuth - 0.7) < 3.0 * degree) return 5.0;
    return 8.0 / std::max(std::abs(std::cos(azimuth)), std::abs(std::sin(azimuth)));
  };
  Scan scan;
  for (std::uint16_t ring = 0; ring < 3; ++ring) {
    const Scan one = ring_scan(-M_PI, M_PI, room, ring, 1.0F - static_cast<float>(ring));
    scan.points_lidar.insert(scan.points_lidar.end(), one.points_lidar.begin(),
                             one.points_lidar.end());
    scan.ring.insert(scan.ring.end(), one.ring.begin(), one.ring.end());
  }
  return scan;
}

using PointSet = std::set<std::tuple<float, float, float>>;

PointSet points_of(const Scan& scan, const std::vector<std::uint32_t>& chosen) {
  PointSet points;
  for (const std::uint32_t i : chosen) {
    const Eigen::Vector3f& p = scan.points_lidar[i];
    points.emplace(p.x(), p.y(), p.z());
  }
  return points;
}

/// A wall facing the lidar at 5 m for azimuth below 0, at 10 m above.
double depth_jump(double azimuth) { return (azimuth < 0.0 ? 5.0 : 10.0) / std::cos(azimuth); }

TEST(ExtractFeatures, FlatWallGivesPlanesAndNoEdges) {
  const Scan scan = ring_scan(-40.0 * degree, 40.0 * degree,
                              [](double azimuth) { return 10.0 / std::cos(azimuth); });
  const Features features = extract_features(scan, FeatureConfig{});
  EXPECT_THAT(features.edges, IsEmpty());
  // 16.8 m of wall in cubes of 0.5 m, without the five points at each end.
  EXPECT_GE(features.planes.size(), 30U);
  EXPECT_LE(features.planes.size(), 35U);
}

TEST(ExtractFeatures, ConvexCornerGivesOneEdgeAtTheCorner) {
  const Scan scan = ring_scan(-20.0 * degree, 20.0 * degree, [](double azimuth) {
    return 5.0 / (std::cos(azimuth) - std::abs(std::sin(azimuth)));
  });
  FeatureConfig config;
  config.edge_curvature_m2 = 0.1;
  const Features features = extract_features(scan, config);
  ASSERT_EQ(features.edges.size(), 1U);
  const Eigen::Vector3f corner(5.0F, 0.0F, 0.0F);
  EXPECT_LE((scan.points_lidar[features.edges[0]] - corner).norm(), 0.05F);
  EXPECT_FALSE(features.planes.empty());
}

TEST(ExtractFeatures, FarSideOfADepthJumpIsRejected) {
  for (const double side : {1.0, -1.0}) {
    const Scan scan = ring_scan(-30.0 * degree, 30.0 * degree,
                                [&](double azimuth) { return depth_jump(side * azimuth); });
    const Features features = extract_features(scan, FeatureConfig{});
    ASSERT_FALSE(features.edges.empty());
    for (const std::uint32_t i : features.edges)
      EXPECT_LT(scan.points_lidar[i].x(), 6.0F) << "an edge that the near wall may hide";
    // Five beams beside the jump at 10 m are 0.17 m.
    for (const std::uint32_t i : features.planes)
      EXPECT_TRUE(scan.points_lidar[i].x() < 6.0F || std::abs(scan.points_lidar[i].y()) > 0.17F);
  }
}

TEST(ExtractFeatures, GrazedSurfaceIsRejected) {
  // A wall along x, 1 m aside: past 15 m the beams' steps on it are above 1.4 % of the range.
  const Scan scan = ring_scan(1.0 * degree, 20.0 * degree,
                              [](double azimuth) { return 1.0 / std::sin(azimuth); });
  const Features features = extract_features(scan, FeatureConfig{});
  EXPECT_THAT(features.edges, IsEmpty());
  ASSERT_FALSE(features.planes.empty());
  for (const std::uint32_t i : features.planes) EXPECT_LT(scan.points_lidar[i].x(), 5.0F);
}

TEST(ExtractFeatures, AFlatWallIsOnePlaneHoweverFarApartItsColumnsAre) {
  for (const double step_degrees : {0.1, 0.2, 0.4, 0.7, 1.0, 2.0}) {
    const Scan scan = ring_scan(
        -80.0 * degree, 80.0 * degree, [](double azimuth) { return 8.0 / std::cos(azimuth); }, 0,
        0.0F, step_degrees * degree);
    const Features features = extract_features(scan, FeatureConfig{});
    EXPECT_THAT(features.edges, IsEmpty()) << step_degrees;
    // 16 m of it face the lidar by 45 degrees or more, in cubes of 0.5 m.
    EXPECT_GE(features.planes.size(), 25U) << step_degrees;
  }
}

TEST(ExtractFeatures, APostIsAnEdgeHoweverFarApartColumnsAre) {
  for (const double step_degrees : {0.2, 0.5, 1.0, 2.0}) {
    const auto post = [&](double azimuth) {
      return std::abs(azimuth) < 0.75 * step_degrees * degree ? 4.0 : 8.0 / std::cos(azimuth);
    };
    const Scan scan =
        ring_scan(-30.0 * degree, 30.0 * degree, post, 0, 0.0F, step_degrees * degree);
    const Features features = extract_features(scan, FeatureConfig{});
    ASSERT_FALSE(features.edges.empty()) << step_degrees;
    for (const std::uint32_t i : features.edges) EXPECT_LT(scan.points_lidar[i].x(), 5.0F);
  }
}

/// Half of the scan's points at random, as simulators drop them.
Scan half_of(const Scan& scan) {
  std::mt19937 random(3);
  Scan half;
  for (std::size_t i = 0; i < scan.size(); ++i) {
    if (random() % 2 == 0) continue;
    half.points_lidar.push_back(scan.points_lidar[i]);
    half.ring.push_back(scan.ring[i]);
  }
  return half;
}

TEST(ExtractFeatures, AFlatWallHasNoEdgesWhereHalfOfTheRaysAreDropped) {
  for (const double step_degrees : {0.2, 0.4, 0.7, 1.0}) {
    const Scan scan = half_of(ring_scan(
        -60.0 * degree, 60.0 * degree, [](double azimuth) { return 8.0 / std::cos(azimuth); }, 0,
        0.0F, step_degrees * degree));
    const Features features = extract_features(scan, FeatureConfig{});
    EXPECT_THAT(features.edges, IsEmpty()) << step_degrees;
    EXPECT_GE(features.planes.size(), 15U) << step_degrees;
  }
}

TEST(ExtractFeatures, ANearRimIsAnEdgeWhereHalfOfTheRaysAreDropped) {
  for (const double step_degrees : {0.2, 0.4}) {
    // The front of a box before a wall that is far off.
    const auto box = [](double azimuth) {
      return (std::abs(azimuth) < 15.0 * degree ? 4.0 : 30.0) / std::cos(azimuth);
    };
    const Scan scan =
        half_of(ring_scan(-60.0 * degree, 60.0 * degree, box, 0, 0.0F, step_degrees * degree));
    const Features features = extract_features(scan, FeatureConfig{});
    const auto rims = std::ranges::count_if(
        features.edges, [&](std::uint32_t i) { return scan.points_lidar[i].x() < 5.0F; });
    EXPECT_GE(rims, 2) << step_degrees;
  }
}

TEST(ExtractFeatures, ACornerIsAnEdgeWhereHalfOfTheRaysAreDropped) {
  // The corner lies at the azimuth of 0.
  const auto corner = [](double azimuth) {
    return 8.0 / (std::cos(azimuth) + std::abs(std::sin(azimuth)));
  };
  const Scan scan = half_of(ring_scan(-30.0 * degree, 30.0 * degree, corner));
  const Features features = extract_features(scan, FeatureConfig{});
  ASSERT_FALSE(features.edges.empty());
  for (const std::uint32_t i : features.edges) EXPECT_LT(std::abs(scan.points_lidar[i].y()), 0.2F);
}

TEST(ExtractFeatures, ShuffledPointsGiveTheSameSets) {
  const Scan scan = room_scan();
  std::vector<std::size_t> order(scan.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::shuffle(order, std::mt19937(1));
  Scan shuffled;
  for (const std::size_t i : order) {
    shuffled.points_lidar.push_back(scan.points_lidar[i]);
    shuffled.ring.push_back(scan.ring[i]);
  }
  const Features expected = extract_features(scan, FeatureConfig{});
  const Features features = extract_features(shuffled, FeatureConfig{});
  EXPECT_EQ(points_of(shuffled, features.edges), points_of(scan, expected.edges));
  EXPECT_EQ(points_of(shuffled, features.planes), points_of(scan, expected.planes));
  EXPECT_FALSE(expected.edges.empty());
}

TEST(ExtractFeatures, EdgesAndPlanesAreDifferentPoints) {
  const Scan scan = room_scan();
  const Features features = extract_features(scan, FeatureConfig{});
  const std::set<std::uint32_t> planes(features.planes.begin(), features.planes.end());
  for (const std::uint32_t i : features.edges) EXPECT_FALSE(planes.contains(i));
  EXPECT_LE(features.registered_planes.size(), features.planes.size());
  for (const std::uint32_t i : features.registered_planes) EXPECT_TRUE(planes.contains(i));
}

TEST(ExtractFeatures, SectorsGiveNoMoreEdgesThanAllowed) {
  // Posts of three beams every four degrees.
  const auto posts = [](double azimuth) {
    return std::fmod(azimuth + M_PI, 4.0 * degree) < 0.6 * degree ? 5.0 : 0.0;
  };
  const Scan scan = ring_scan(-M_PI, M_PI, posts);
  FeatureConfig config;
  config.edge_curvature_m2 = 0.01;
  config.edge_spacing_m = 0.001;
  const auto edges_with = [&](int edges_per_sector) {
    config.edges_per_sector = edges_per_sector;
    return extract_features(scan, config).edges.size();
  };
  EXPECT_EQ(edges_with(0), 0U);
  EXPECT_LE(edges_with(2), 12U);
  EXPECT_LT(edges_with(2), edges_with(20));
}

TEST(ExtractFeatures, EmptyScanHasNone) {
  const Features features = extract_features(Scan{}, FeatureConfig{});
  EXPECT_THAT(features.edges, IsEmpty());
  EXPECT_THAT(features.planes, IsEmpty());
  EXPECT_THAT(features.registered_planes, IsEmpty());
}

TEST(ExtractFeatures, EqualPointsHaveNoEdges) {
  Scan scan;
  scan.points_lidar.assign(1000, Eigen::Vector3f(5.0F, 1.0F, 0.0F));
  scan.ring.assign(1000, 7);
  const Features features = extract_features(scan, FeatureConfig{});
  EXPECT_THAT(features.edges, IsEmpty());
  EXPECT_LE(features.planes.size(), 1U);
}

TEST(ExtractFeatures, ShortRingHasNone) {
  const Scan scan = ring_scan(0.0, 2.0 * degree, [](double) { return 10.0; });
  ASSERT_EQ(scan.size(), 10U);
  const Features features = extract_features(scan, FeatureConfig{});
  EXPECT_THAT(features.edges, IsEmpty());
  EXPECT_THAT(features.planes, IsEmpty());
}

TEST(HasSparseRings, TellsLidarsByTheAngleBetweenTheirRings) {
  EXPECT_TRUE(has_sparse_rings(vlp_16()));
  EXPECT_FALSE(has_sparse_rings(hdl_32e()));
  EXPECT_FALSE(has_sparse_rings(hdl_64e()));
  SensorModel half = hdl_64e();
  half.rings = 16;
  EXPECT_TRUE(has_sparse_rings(half));
  half.pattern = ScanPattern::irregular;
  EXPECT_FALSE(has_sparse_rings(half)) << "it has none";
}

TEST(BalanceOf, IsTheShareOfDirectionsWithSomethingOpposite) {
  const auto balance = [](double span_degrees) {
    std::vector<Eigen::Vector3f> points;
    for (double azimuth = 0.5; azimuth < span_degrees; azimuth += 1.0)
      points.emplace_back(10.0F * std::cos(azimuth * degree), 10.0F * std::sin(azimuth * degree),
                          1.0F);
    std::vector<std::uint32_t> all(points.size());
    std::iota(all.begin(), all.end(), 0U);
    return balance_of(points, all);
  };
  EXPECT_EQ(balance(360.0), 1.0);
  EXPECT_NEAR(balance(270.0), 2.0 / 3.0, 0.01);
  EXPECT_EQ(balance(180.0), 0.0);
  EXPECT_EQ(balance(90.0), 0.0);
  EXPECT_EQ(balance(0.0), 1.0) << "nothing is seen";
}

TEST(RingCurvature, IsTheSquaredSumOfTenDifferences) {
  const Scan scan = ring_scan(-5.0 * degree, 5.0 * degree, [](double azimuth) {
    return 5.0 / (std::cos(azimuth) - std::abs(std::sin(azimuth)));
  });
  const std::vector<Eigen::Vector3f>& ring = scan.points_lidar;
  const std::vector<float> curvature = ring_curvature(ring);
  ASSERT_EQ(curvature.size(), ring.size());
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const bool at_an_end = i < 5 || i + 5 >= ring.size();
    ASSERT_EQ(std::isnan(curvature[i]), at_an_end);
    if (at_an_end) continue;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t j = i - 5; j <= i + 5; ++j) sum += (ring[j] - ring[i]).cast<double>();
    EXPECT_NEAR(curvature[i], sum.squaredNorm(), 1e-4);
  }
}

TEST(ExtractSurfaces, TellsLevelGroundFromWhatStandsUp) {
  Scan scan;
  for (float x = -9.0F; x < 9.0F; x += 0.1F) {
    for (float y = -9.0F; y < 9.0F; y += 0.1F) scan.points_lidar.emplace_back(x, y, -1.7F);
    for (float z = -1.7F; z < 2.0F; z += 0.1F) scan.points_lidar.emplace_back(x, 9.5F, z);
  }
  const Features features = extract_surfaces(scan, FeatureConfig{});
  EXPECT_TRUE(features.tangents.empty()) << "no rings";
  ASSERT_EQ(features.is_level.size(), scan.size());
  std::size_t level = 0, upright = 0;
  for (const std::uint32_t i : features.surfaces) {
    const bool is_wall = scan.points_lidar[i].y() > 9.2F;
    EXPECT_EQ(features.is_level[i], !is_wall) << scan.points_lidar[i].transpose();
    (is_wall ? upright : level) += 1;
  }
  EXPECT_GT(level, 50U);
  EXPECT_GT(upright, 50U);
}

TEST(ExtractSurfaces, TellsLevelGroundWhereTheLidarLiesOnItsSide) {
  const Eigen::Matrix3f R_level_lidar =
      Eigen::AngleAxisf(0.5F * std::numbers::pi_v<float>, Eigen::Vector3f::UnitX())
          .toRotationMatrix();
  Scan scan;
  std::vector<bool> is_wall;
  const auto see = [&](float x, float y, float z) {
    scan.points_lidar.push_back(R_level_lidar.transpose() * Eigen::Vector3f(x, y, z));
    is_wall.push_back(y > 9.2F);
  };
  for (float x = -9.0F; x < 9.0F; x += 0.1F) {
    for (float y = -9.0F; y < 9.0F; y += 0.1F) see(x, y, -1.7F);
    for (float z = -1.7F; z < 2.0F; z += 0.1F) see(x, 9.5F, z);
  }
  const Eigen::Vector3f up_lidar = R_level_lidar.row(2).transpose();
  const Features features = extract_surfaces(scan, FeatureConfig{}, up_lidar);
  for (const std::uint32_t i : features.surfaces) EXPECT_EQ(features.is_level[i], !is_wall[i]);
  ASSERT_GT(features.upright_points.size(), 20U);
  ASSERT_GT(features.level_points.size(), 50U);
  for (const std::uint32_t i : features.upright_points) EXPECT_TRUE(is_wall[i]);
  for (const std::uint32_t i : features.level_points) EXPECT_FALSE(is_wall[i]);
}

TEST(ExtractSurfaces, TellsLevelGroundBelowARobotOnASlopeAndALidarThatLeansOnItsMount) {
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0.0F, 0.02F);
  const Eigen::Matrix3f R_map_slope =
      Eigen::AngleAxisf(0.6F, Eigen::Vector3f(1.0F, 1.0F, 0.0F).normalized()).toRotationMatrix();
  Scan on_slope, on_level_ground;
  for (float x = -9.0F; x < 9.0F; x += 0.1F)
    for (float y = -9.0F; y < 9.0F; y += 0.1F) {
      const Eigen::Vector3f point(x, y, -1.2F + noise(random));
      on_slope.points_lidar.push_back(point);
      on_level_ground.points_lidar.push_back(R_map_slope.transpose() * point);
    }
  const Eigen::Vector3f up_lidar = R_map_slope.row(2).transpose();
  for (const Scan* scan : {&on_slope, &on_level_ground}) {
    const Features features = extract_surfaces(*scan, FeatureConfig{}, up_lidar);
    for (const std::uint32_t i : features.surfaces) EXPECT_TRUE(features.is_level[i]);
    EXPECT_TRUE(features.upright_points.empty());
  }
}

}  // namespace
}  // namespace stillmap
