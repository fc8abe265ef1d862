#include "core/odometry/ring_start.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

Eigen::Isometry3d at_x(double x) { return Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, 0.0)); }

/// A scan of a level square of 9 m x 9 m, a metre below the lidar and ahead of it.
FeatureSets square() {
  FeatureSets sets;
  for (int x = 0; x < 19; ++x)
    for (int y = 0; y < 19; ++y) {
      FeaturePoint point;
      point.position_lidar = {0.5F * static_cast<float>(x), 0.5F * static_cast<float>(y), -1.0F};
      sets.planes.push_back(point);
      sets.surfaces.push_back(point);
    }
  return sets;
}

TEST(RingStart, CountsPlacesAndNoScansFromWhereOneWas) {
  RingStart start;
  for (int k = 0; k < 50; ++k) start.add({}, {}, at_x(0.001 * k));
  EXPECT_FALSE(start.is_complete()) << "stands";
  for (int k = 1; k < 9; ++k) start.add({}, {}, at_x(0.4 * k));
  EXPECT_FALSE(start.is_complete());
  start.add({}, {}, at_x(0.4 * 9));
  EXPECT_TRUE(start.is_complete());
  start.clear();
  EXPECT_FALSE(start.is_complete());
}

TEST(RingStart, MapsWhatWasSeenFromAllPlacesAndKnowsHowItFits) {
  RingStart start;
  for (int k = 0; k < 10; ++k) start.add(square(), square(), at_x(0.5 * k));
  const RingStart::BySurfaces by_surfaces = start.by_surfaces(OdometryConfig{});
  // Its columns, and one more from each place after the first.
  EXPECT_EQ(by_surfaces.map.planes.size(), 19U * (19U + 9U));
  EXPECT_TRUE(by_surfaces.fits.are_known());
}

TEST(RingStart, GoesOnInAMapMadeEarlier) {
  RingStart start;
  const LabelledPoint far_wall{{-20.0F, 0.0F, 1.0F}, SemanticClass::unlabeled};
  start.set_prior_map({&far_wall, 1});
  start.add(square(), square(), at_x(0.0));
  start.clear();
  EXPECT_FALSE(start.is_complete());
  for (int k = 0; k < 10; ++k) start.add(square(), square(), at_x(0.5 * k));
  const LocalMap map = start.by_surfaces(OdometryConfig{}).map;
  EXPECT_EQ(map.planes.size(), 1U + 19U * (19U + 9U));
  EXPECT_EQ(map.points.nearest(far_wall.position_map, 1, 0.1F).count, 1);
}

TEST(RingStart, KeepsTheLastOnesOfALongStart) {
  RingStart start;
  for (int k = 0; k < 300; ++k) start.add(square(), square(), at_x(1.0 * k));
  const RingStart::BySurfaces by_surfaces = start.by_surfaces(OdometryConfig{});
  EXPECT_LE(by_surfaces.map.planes.size(), 19U * (19U + 2U * 29U));
}

}  // namespace
}  // namespace stillmap
