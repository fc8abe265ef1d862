#include "core/odometry/correspondence.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
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
    const bool is_wide = values[1] > 0.05 * values[2];
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

}  // namespace
}  // namespace stillmap
