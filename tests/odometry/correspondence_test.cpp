#include "core/odometry/correspondence.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::random_pose;
using test::random_vector;

Neighbours neighbours_at(const std::vector<Eigen::Vector3d>& positions) {
  Neighbours neighbours;
  for (const Eigen::Vector3d& p : positions)
    neighbours.points[static_cast<std::size_t>(neighbours.count++)].position_map = p.cast<float>();
  return neighbours;
}

/// Points a + s u, s = -2, -1, 0, 1, 2 times `spacing_m`, each moved aside by up to `noise_m`.
std::vector<Eigen::Vector3d> line_points(const Eigen::Vector3d& a, const Eigen::Vector3d& u,
                                         double spacing_m, double noise_m, std::mt19937& random) {
  std::vector<Eigen::Vector3d> points;
  for (int k = -2; k <= 2; ++k)
    points.push_back(a + k * spacing_m * u + random_vector(random, noise_m));
  return points;
}

struct PlaneCase {
  Eigen::Vector3d centre;
  Eigen::Vector3d along;
  Eigen::Vector3d across;
  [[nodiscard]] Eigen::Vector3d normal() const { return along.cross(across); }
};

PlaneCase random_plane(std::mt19937& random) {
  const Eigen::Isometry3d T = random_pose(random, 30.0);
  return {T.translation(), T.linear().col(0), T.linear().col(1)};
}

std::vector<Eigen::Vector3d> plane_points(const PlaneCase& plane, double noise_m,
                                          std::mt19937& random) {
  std::vector<Eigen::Vector3d> points{plane.centre};
  for (const double s : {-0.4, 0.4})
    for (const double t : {-0.3, 0.3})
      points.push_back(plane.centre + s * plane.along + t * plane.across);
  for (Eigen::Vector3d& p : points) p += random_vector(random, noise_m);
  return points;
}

/// Eq. (8): |PA x PB| / |AB|.
double distance_to_line(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                        const Eigen::Vector3d& b) {
  return (a - p).cross(b - p).norm() / (b - a).norm();
}

/// Eq. (12): |Ax + By + Cz + D| / |(A, B, C)|.
double distance_to_plane(const Eigen::Vector3d& p, const Eigen::Vector3d& n, double d) {
  return std::abs(n.x() * p.x() + n.y() * p.y() + n.z() * p.z() + d) / n.norm();
}

TEST(FitLine, ResidualIsTheDistanceOfEquation8) {
  std::mt19937 random(1);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d a = random_vector(random, 30.0);
    const Eigen::Vector3d u = random_vector(random, 1.0).normalized();
    const auto line = fit_line(neighbours_at(line_points(a, u, 0.25, 0.0, random)));
    ASSERT_TRUE(line);
    const Eigen::Isometry3d T = random_pose(random, 2.0);
    const Eigen::Vector3d p_lidar = T.inverse() * (a + random_vector(random, 1.0));
    const double d = std::sqrt(residual(p_lidar, T, *line).squared_norm());
    EXPECT_NEAR(d, distance_to_line(T * p_lidar, a - u, a + 2.0 * u), 1e-4);
  }
}

/// Length of the part of a vector that leads off the surface.
double off_surface(const FittedSurface& surface, const Eigen::Vector3d& v) {
  double squared = 0.0;
  for (std::size_t k = 0; k < surface.normal_count; ++k)
    squared += std::pow(surface.normals[k].dot(v), 2);
  return std::sqrt(squared);
}

TEST(FitLine, NoisyPointsGiveTheLineNearly) {
  std::mt19937 random(2);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d a = random_vector(random, 30.0);
    const Eigen::Vector3d u = random_vector(random, 1.0).normalized();
    const auto line = fit_line(neighbours_at(line_points(a, u, 0.3, 0.02, random)));
    ASSERT_TRUE(line);
    EXPECT_LE(off_surface(*line, u), 0.1);
    EXPECT_LE(off_surface(*line, line->centre_map - a), 0.02);
  }
}

TEST(FitLine, RejectsWhatIsNoLine) {
  std::mt19937 random(3);
  auto points = line_points({1.0, 2.0, 3.0}, {1.0, 0.0, 0.0}, 0.3, 0.0, random);
  points.pop_back();
  EXPECT_FALSE(fit_line(neighbours_at(points))) << "four points";
  EXPECT_FALSE(fit_line(neighbours_at(plane_points(random_plane(random), 0.0, random)))) << "plane";
  EXPECT_FALSE(fit_line(neighbours_at(std::vector<Eigen::Vector3d>(5, {1.0, 2.0, 3.0}))))
      << "one place has no direction";
  EXPECT_FALSE(fit_line(Neighbours{}));
}

TEST(FitPlane, ResidualIsTheDistanceOfEquation12) {
  std::mt19937 random(4);
  for (int k = 0; k < 200; ++k) {
    const PlaneCase truth = random_plane(random);
    const auto plane = fit_plane(neighbours_at(plane_points(truth, 0.0, random)));
    ASSERT_TRUE(plane);
    const Eigen::Isometry3d T = random_pose(random, 2.0);
    const Eigen::Vector3d p_lidar = T.inverse() * (truth.centre + random_vector(random, 1.0));
    const double d = std::sqrt(residual(p_lidar, T, *plane).squared_norm());
    const Eigen::Vector3d n = 3.0 * truth.normal();
    EXPECT_NEAR(d, distance_to_plane(T * p_lidar, n, -n.dot(truth.centre)), 1e-4);
  }
}

TEST(FitPlane, IsAsThickAsItsPointsDeviate) {
  const std::vector<Eigen::Vector3d> points{
      {0.0, 0.0, 0.1}, {1.0, 0.0, -0.1}, {1.0, 1.0, 0.1}, {0.0, 1.0, -0.1}, {0.5, 0.5, 0.0}};
  const auto plane = fit_plane(neighbours_at(points));
  ASSERT_TRUE(plane);
  EXPECT_NEAR(plane->variance_m2, 4.0 * 0.01 / 5.0, 1e-6);
}

TEST(FitPlane, NoisyPointsGiveThePlaneNearly) {
  std::mt19937 random(5);
  for (int k = 0; k < 200; ++k) {
    const PlaneCase truth = random_plane(random);
    const auto plane = fit_plane(neighbours_at(plane_points(truth, 0.02, random)));
    ASSERT_TRUE(plane);
    EXPECT_LE(off_surface(*plane, truth.along), 0.15);
    EXPECT_LE(off_surface(*plane, truth.across), 0.15);
    EXPECT_LE(off_surface(*plane, plane->centre_map - truth.centre), 0.03);
  }
}

TEST(FitPlane, HasTheNormalThatAGeneralSolverFinds) {
  std::mt19937 random(9);
  int planes = 0;
  for (int k = 0; k < 2000; ++k) {
    // From nearly flat to a ball, and from wide to a line.
    const Eigen::Isometry3d T = random_pose(random, 30.0);
    const Eigen::Vector3d size(0.4, 0.4 * std::pow(0.5, k % 7), 0.15 * std::pow(0.5, k % 5));
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 5 + k % 4; ++i)
      points.push_back(T * random_vector(random, 1.0).cwiseProduct(size));
    const Neighbours neighbours = neighbours_at(points);
    Eigen::Matrix3Xd at(3, neighbours.count);
    for (int i = 0; i < neighbours.count; ++i)
      at.col(i) = neighbours.points[static_cast<std::size_t>(i)].position_map.cast<double>();
    const Eigen::Matrix3Xd off = at.colwise() - at.rowwise().mean();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(off * off.transpose());
    const Eigen::Vector3d values = solver.eigenvalues();
    const Eigen::Vector3d normal = solver.eigenvectors().col(0);
    const bool is_wide = values[1] > 0.1 * values[2];
    const bool is_thin = (normal.transpose() * off).cwiseAbs().maxCoeff() <= 0.2;
    const auto plane = fit_plane(neighbours);
    ASSERT_EQ(plane.has_value(), is_wide && is_thin) << "case " << k;
    if (!plane) continue;
    ++planes;
    EXPECT_EQ(plane->normal_count, 1U);
    EXPECT_NEAR(plane->normals[0].norm(), 1.0, 1e-12);
    // Where the two smallest eigenvalues are alike, the normal is anybody's guess.
    const double gap = (values[1] - values[0]) / values[2];
    EXPECT_LE(plane->normals[0].cross(normal).norm(), 1e-12 / (gap * gap)) << "case " << k;
  }
  EXPECT_GT(planes, 500);
}

TEST(Extrapolation, IsInStandardDeviationsOfThePlanesNeighboursAlongIt) {
  std::mt19937 random(17);
  for (int k = 0; k < 50; ++k) {
    const PlaneCase plane = random_plane(random);
    const Neighbours neighbours = neighbours_at(plane_points(plane, 0.0, random));
    const auto fitted = fit_plane(neighbours);
    ASSERT_TRUE(fitted);
    // Four of five points lie 0.4 m along and 0.3 m across from the middle.
    const double along_m = 0.4 * std::sqrt(0.8);
    const double across_m = 0.3 * std::sqrt(0.8);
    const auto at = [&](double along, double across, double above_m) {
      return extrapolation(*fitted, neighbours,
                           plane.centre + along * along_m * plane.along +
                               across * across_m * plane.across + above_m * plane.normal());
    };
    EXPECT_NEAR(at(0.0, 0.0, 0.0), 0.0, 1e-3);
    EXPECT_NEAR(at(2.0, 0.0, 0.0), 2.0, 1e-3);
    EXPECT_NEAR(at(0.0, -1.5, 0.0), 1.5, 1e-3);
    EXPECT_NEAR(at(3.0, 4.0, 0.0), 5.0, 1e-3);
    // How far off the plane is what registration is to find out.
    EXPECT_NEAR(at(1.0, 0.0, 0.5), 1.0, 1e-3);
  }
}

/// As on two rings of a lidar, one point of the other ring beside four of one.
TEST(FitPlane, RejectsWhatIsNarrowerThanAsked) {
  const std::vector<Eigen::Vector3d> points{
      {0.0, 0.0, 0.0}, {0.3, 0.0, 0.0}, {0.6, 0.0, 0.0}, {0.9, 0.0, 0.0}, {0.45, 0.5, 0.0}};
  // Variances of 0.09 and 0.04 m^2.
  EXPECT_TRUE(fit_plane(neighbours_at(points), 0.4));
  EXPECT_FALSE(fit_plane(neighbours_at(points), 0.5));
  const auto surface = fit_surface(neighbours_at(points), 0.4);
  ASSERT_TRUE(surface);
  EXPECT_EQ(surface->normal_count, 1U);
  EXPECT_FALSE(fit_surface(neighbours_at(points), 0.5)) << "and no line either";
}

TEST(FitPlane, RejectsWhatIsNoPlane) {
  std::mt19937 random(6);
  const PlaneCase truth = random_plane(random);
  auto points = plane_points(truth, 0.0, random);
  points.push_back(truth.centre + 0.5 * truth.normal());
  EXPECT_FALSE(fit_plane(neighbours_at(points))) << "one point stands out by half a metre";
  points.resize(4);
  EXPECT_FALSE(fit_plane(neighbours_at(points))) << "four points";
  EXPECT_FALSE(
      fit_plane(neighbours_at(line_points({1.0, 2.0, 3.0}, {0.6, 0.8, 0.0}, 0.3, 0.0, random))))
      << "a line lies on many planes";
  EXPECT_FALSE(fit_plane(neighbours_at(std::vector<Eigen::Vector3d>(5, {1.0, 2.0, 3.0}))));
  EXPECT_FALSE(fit_plane(Neighbours{}));
}

/// Central differences of the residual by the pose tangent.
void expect_jacobian_is_the_slope(const Eigen::Vector3d& p_lidar, const Eigen::Isometry3d& T,
                                  const FittedSurface& surface) {
  constexpr double step = 1e-6;
  const Residual at = residual(p_lidar, T, surface);
  for (int axis = 0; axis < 6; ++axis) {
    const PoseTangent xi = step * PoseTangent::Unit(axis);
    const Residual after = residual(p_lidar, boxplus(T, xi), surface);
    const Residual before = residual(p_lidar, boxplus(T, -xi), surface);
    for (std::size_t k = 0; k < at.count; ++k) {
      const double slope = (after.distances[k] - before.distances[k]) / (2.0 * step);
      EXPECT_NEAR(slope, at.slopes[k][axis], 1e-6) << "axis " << axis << ", normal " << k;
    }
  }
}

/// A line along x or another axis through a point that the lidar sees.
FittedSurface line_through(const Eigen::Vector3d& p_map, const Eigen::Vector3d& along_map) {
  const Eigen::Vector3d side = along_map.unitOrthogonal();
  return {p_map, {side, along_map.cross(side)}, 2};
}

/// The ring of a lidar on a wall: a point, and the direction in which the ring goes on.
struct RingOnWall {
  Eigen::Vector3d point_lidar;
  Eigen::Vector3d along_lidar;
};

RingOnWall ring_on_wall(double distance_m, double azimuth_rad, double elevation_rad) {
  // The wall is at right angles to x: all of its points have this x.
  const auto at = [&](double azimuth) {
    return Eigen::Vector3d(distance_m, distance_m * std::tan(azimuth),
                           distance_m * std::tan(elevation_rad) / std::cos(azimuth));
  };
  constexpr double step = 1e-5;
  return {at(azimuth_rad), (at(azimuth_rad + step) - at(azimuth_rad - step)).normalized()};
}

TEST(RingLine, CountsLittleAcrossTheRings) {
  std::mt19937 random(7);
  for (const double elevation_deg : {-15.0, -3.0, 7.0, 15.0}) {
    for (const double azimuth_deg : {-60.0, 0.0, 35.0}) {
      const RingOnWall ring =
          ring_on_wall(12.0, azimuth_deg * M_PI / 180.0, elevation_deg * M_PI / 180.0);
      const Eigen::Isometry3d T_map_lidar = random_pose(random, 30.0);
      const FittedSurface line =
          line_through(T_map_lidar * ring.point_lidar, T_map_lidar.linear() * ring.along_lidar);
      const FittedSurface left =
          weighed_ring_line(line, ring.point_lidar, T_map_lidar.linear(), {1.0, 0.25});
      ASSERT_EQ(left.normal_count, 2U);
      EXPECT_EQ(left.weights, (std::array{1.0, 0.25}));
      // The distance to the line is the same.
      const Eigen::Vector3d beside = ring.point_lidar + random_vector(random, 0.5);
      EXPECT_NEAR(residual(beside, T_map_lidar, left).squared_norm(),
                  residual(beside, T_map_lidar, line).squared_norm(), 1e-9);
      // As the lidar turns its rings up or down, the residual stays; as it comes nearer it does
      // not.
      const Eigen::Vector3d ray = ring.point_lidar.normalized();
      const Eigen::Vector3d up = (Eigen::Vector3d::UnitZ() - ray.z() * ray).normalized();
      const Eigen::Vector3d normal_lidar = T_map_lidar.linear().transpose() * left.normals[0];
      EXPECT_NEAR(normal_lidar.dot(up), 0.0, 1e-6);
      EXPECT_NEAR(normal_lidar.dot(ring.along_lidar), 0.0, 1e-6);
      EXPECT_GT(std::abs(normal_lidar.dot(ray)), 0.4);
    }
  }
}

TEST(RingLine, MayCountNothingAlongTheRay) {
  const RingOnWall ring = ring_on_wall(12.0, 0.3, -0.1);
  const FittedSurface line = line_through(ring.point_lidar, ring.along_lidar);
  const FittedSurface left =
      weighed_ring_line(line, ring.point_lidar, Eigen::Matrix3d::Identity(), {0.0, 1.0});
  EXPECT_EQ(left.weights, (std::array{0.0, 1.0}));
}

TEST(RingLine, StaysAsItIsWhereItCrossesTheRings) {
  const Eigen::Vector3d at_pole(9.0, -4.0, 1.5);
  const Eigen::Matrix3d R_map_lidar =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const auto left_of = [&](const Eigen::Vector3d& along_map, double weight) {
    const FittedSurface line = line_through(R_map_lidar * at_pole, along_map.normalized());
    return weighed_ring_line(line, at_pole, R_map_lidar, {1.0, weight});
  };
  for (const FittedSurface& left : {left_of(Eigen::Vector3d::UnitZ(), 0.3),
                                    left_of({0.3, 0.2, 1.0}, 0.3), left_of({1.0, 0.0, 0.0}, 1.0)}) {
    EXPECT_EQ(left.normal_count, 2U);
    EXPECT_EQ(left.weights, (std::array{1.0, 1.0}));
  }
}

TEST(RingLine, StaysWhatIsNoLineOrLiesOnTheAxis) {
  const FittedSurface plane{Eigen::Vector3d::Zero(), {Eigen::Vector3d::UnitX()}, 1};
  EXPECT_EQ(
      weighed_ring_line(plane, {5.0, 0.0, 0.0}, Eigen::Matrix3d::Identity(), {1.0, 0.3}).weights,
      (std::array{1.0, 1.0}));
  const FittedSurface line = line_through({0.0, 0.0, 3.0}, Eigen::Vector3d::UnitX());
  EXPECT_EQ(
      weighed_ring_line(line, {0.0, 0.0, 3.0}, Eigen::Matrix3d::Identity(), {1.0, 0.3}).weights,
      (std::array{1.0, 1.0}));
}

TEST(Residual, JacobianOfALineIsItsNumericalDerivative) {
  std::mt19937 random(7);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d a = random_vector(random, 30.0);
    const Eigen::Vector3d u = random_vector(random, 1.0).normalized();
    const auto line = fit_line(neighbours_at(line_points(a, u, 0.3, 0.02, random)));
    ASSERT_TRUE(line);
    expect_jacobian_is_the_slope(random_vector(random, 40.0), random_pose(random, 40.0), *line);
  }
}

TEST(Residual, JacobianOfAPlaneIsItsNumericalDerivative) {
  std::mt19937 random(8);
  for (int k = 0; k < 200; ++k) {
    const auto points = plane_points(random_plane(random), 0.02, random);
    const auto plane = fit_plane(neighbours_at(points));
    ASSERT_TRUE(plane);
    expect_jacobian_is_the_slope(random_vector(random, 40.0), random_pose(random, 40.0), *plane);
  }
}

TEST(SurfaceAlong, AColumnOfASmoothWallIsThePlaneThroughItsRing) {
  const FittedSurface column{
      {30.0, 4.0, 1.0}, {Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitX()}, 2};
  const auto wall = surface_along(column, Eigen::Vector3d(1.0, 0.0, -0.05).normalized());
  ASSERT_TRUE(wall);
  EXPECT_EQ(wall->normal_count, 1U);
  EXPECT_TRUE(wall->centre_map.isApprox(column.centre_map));
  EXPECT_NEAR(std::abs(wall->normals[0].y()), 1.0, 1e-9);
  // A line along the ring says nothing of the surface across it.
  const auto along = surface_along(column, Eigen::Vector3d(0.1, 0.0, 1.0).normalized());
  ASSERT_TRUE(along);
  EXPECT_EQ(along->normal_count, 2U);
  const auto unknown = surface_along(column, Eigen::Vector3d::Zero());
  ASSERT_TRUE(unknown);
  EXPECT_EQ(unknown->normal_count, 2U);
}

TEST(SurfaceAlong, APlaneContainsTheRingOrIsNone) {
  const Eigen::Vector3d ring = Eigen::Vector3d::UnitX();
  const auto leaning_by = [](double sine) {
    FittedSurface plane{
        Eigen::Vector3d(30.0, 4.0, 1.0),
        {Eigen::Vector3d(sine, std::sqrt(1.0 - sine * sine), 0.0), Eigen::Vector3d::Zero()},
        1};
    plane.variance_m2 = 0.001;
    return plane;
  };
  const auto noise = surface_along(leaning_by(0.4), ring);
  ASSERT_TRUE(noise);
  EXPECT_NEAR(noise->normals[0].x(), 0.4, 1e-12);
  for (const double sine : {-0.6, 0.55, 0.7}) {
    const auto turned = surface_along(leaning_by(sine), ring);
    ASSERT_TRUE(turned) << sine;
    EXPECT_NEAR(turned->normals[0].dot(ring), 0.0, 1e-12);
    EXPECT_NEAR(turned->normals[0].norm(), 1.0, 1e-12);
    EXPECT_EQ(turned->variance_m2, 0.001);
  }
  EXPECT_FALSE(surface_along(leaning_by(0.9), ring));
  EXPECT_TRUE(surface_along(leaning_by(0.9), Eigen::Vector3d::Zero()));
}

}  // namespace
}  // namespace stillmap
