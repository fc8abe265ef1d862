#include "core/odometry/correlative_search.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace stillmap {
namespace {

/// House fronts and poles, as points 0.3 m apart.
std::vector<Eigen::Vector3f> quarter(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> place(-60.0F, 60.0F), heading(0.0F, 3.14F),
      length(4.0F, 20.0F);
  std::vector<Eigen::Vector3f> landmarks_map;
  for (int k = 0; k < 40; ++k) {
    const Eigen::Vector3f begin(place(random), place(random), 0.0F);
    const float a = heading(random);
    const float length_m = length(random);
    for (float along = 0.0F; along < length_m; along += 0.3F)
      for (float up = -1.0F; up < 3.0F; up += 1.0F)
        landmarks_map.push_back(begin +
                                Eigen::Vector3f(along * std::cos(a), along * std::sin(a), up));
  }
  return landmarks_map;
}

Eigen::Isometry3d pose(double x, double y, double heading_rad) {
  return Eigen::Translation3d(x, y, 0.2) * Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ());
}

std::vector<Eigen::Vector3f> seen_from(const std::vector<Eigen::Vector3f>& landmarks_map,
                                       const Eigen::Isometry3d& T_map_lidar) {
  std::vector<Eigen::Vector3f> seen;
  for (std::size_t i = 0; i < landmarks_map.size(); i += 3) {
    const Eigen::Vector3f p =
        (T_map_lidar.inverse() * landmarks_map[i].cast<double>()).cast<float>();
    if (p.norm() < 35.0F) seen.push_back(p);
  }
  return seen;
}

TEST(CorrelativeSearch, FindsAnyPlaceAndHeadingWithinReach) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const auto landmarks_map = quarter(seed);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> offset(-22.0, 22.0), turn(-3.1, 3.1);
    const Eigen::Isometry3d truth = pose(offset(random), offset(random), turn(random));
    const auto found =
        correlative_search(seen_from(landmarks_map, truth), landmarks_map, pose(0.0, 0.0, 0.0), 8);
    ASSERT_FALSE(found.empty());
    ASSERT_LE(found.size(), 8U);
    const Eigen::Isometry3d off = truth.inverse() * found.front();
    EXPECT_LT(off.translation().head<2>().norm(), 1.0) << seed;
    EXPECT_LT(std::abs(Eigen::AngleAxisd(off.linear()).angle()), 0.05) << seed;
  }
}

TEST(CorrelativeSearch, KeepsCandidatesApart) {
  const auto landmarks_map = quarter(7);
  const CorrelativeSearchConfig config;
  const auto found = correlative_search(seen_from(landmarks_map, pose(3.0, 4.0, 1.0)),
                                        landmarks_map, pose(0.0, 0.0, 0.0), 16, config);
  ASSERT_GT(found.size(), 4U);
  for (std::size_t a = 0; a < found.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const Eigen::Isometry3d off = found[a].inverse() * found[b];
      EXPECT_TRUE(off.translation().norm() >= config.spacing_m ||
                  Eigen::AngleAxisd(off.linear()).angle() >= config.spacing_rad - 1e-6);
    }
  }
}

TEST(CorrelativeSearch, FindsNothingWhereNothingStands) {
  const auto landmarks_map = quarter(3);
  EXPECT_TRUE(correlative_search({}, landmarks_map, pose(0, 0, 0), 4).empty());
  const auto seen = seen_from(landmarks_map, pose(0, 0, 0));
  EXPECT_TRUE(correlative_search(seen, {}, pose(0, 0, 0), 4).empty());
  EXPECT_TRUE(correlative_search(seen, landmarks_map, pose(1e4, 0, 0), 4).empty());
}

}  // namespace
}  // namespace stillmap
