#include "tests/occupancy/random_scans.hpp"

#include <random>

namespace stillmap::test {

PlacedScan random_scan(std::uint32_t seed, int points, double range_m) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> along(-1.0, 1.0);
  std::uniform_int_distribution<int> motion(0, 5);
  PlacedScan placed;
  placed.T_map_lidar.translate(Eigen::Vector3d(along(generator), along(generator), 0.3));
  placed.T_map_lidar.rotate(Eigen::AngleAxisd(along(generator), Eigen::Vector3d::UnitZ()));
  for (int i = 0; i < points; ++i) {
    const Eigen::Vector3d p(along(generator), along(generator), 0.4 * along(generator));
    placed.scan.scan.points_lidar.emplace_back((range_m * p).cast<float>());
    const int kind = motion(generator);
    placed.scan.motion.push_back(kind == 0   ? Motion::highly_dynamic
                                 : kind == 1 ? Motion::semi_static
                                             : Motion::stationary);
  }
  return placed;
}

LabelledScan one_point(const Eigen::Vector3f& p_lidar, Motion motion) {
  LabelledScan scan;
  scan.scan.points_lidar = {p_lidar};
  scan.motion = {motion};
  return scan;
}

}  // namespace stillmap::test
