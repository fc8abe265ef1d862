#include "core/map/submap_list.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

Eigen::Isometry3d pose(double x, double turn_rad) {
  return Eigen::Translation3d(x, 2.0, -1.0) *
         Eigen::AngleAxisd(turn_rad, Eigen::Vector3d(0.1, 0.2, 0.97).normalized());
}

TEST(SubmapList, LoopsJoinTheSamePlacesInWhateverFrameOfTheRobot) {
  SubmapList of_lidar;
  of_lidar.submaps = {{1, 0.0, pose(0, 0.3)}, {2, 25.0, pose(25, -1.0)}};
  of_lidar.loops.push_back(
      {.from = 0,
       .to = 1,
       .T_from_to = of_lidar.submaps[0].T_map_submap.inverse() * of_lidar.submaps[1].T_map_submap});
  const Eigen::Isometry3d T_lidar_base = pose(0.4, 1.5);
  const SubmapList of_base = of_frame(of_lidar, T_lidar_base);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(
        of_base.submaps[i].T_map_submap.isApprox(of_lidar.submaps[i].T_map_submap * T_lidar_base));
  }
  EXPECT_TRUE(of_base.loops[0].T_from_to.isApprox(of_base.submaps[0].T_map_submap.inverse() *
                                                  of_base.submaps[1].T_map_submap));
}

}  // namespace
}  // namespace stillmap
