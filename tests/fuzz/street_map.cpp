#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
namespace {

constexpr double lidar_height_m = 1.73;

void add(LabelledScan& scan, double x, double y, double z, SemanticClass label, Motion motion) {
  scan.scan.points_lidar.push_back(Eigen::Vector3d(x, y, z - lidar_height_m).cast<float>());
  scan.labels.classes.push_back(label);
  scan.labels.confidence.push_back(0.9F);
  scan.motion.push_back(motion);
}

/// From a lidar over the map's origin.
LabelledScan street_scan() {
  LabelledScan scan;
  scan.scan.stamp_ns = 1'700'000'000'000'000'000;
  for (double x = -2.9; x < 3.0; x += 0.2) {
    for (double y = -2.9; y < 3.0; y += 0.2) {
      add(scan, x, y, 0.05, SemanticClass::road, Motion::stationary);
    }
    for (double z = 0.1; z < 1.0; z += 0.2) {
      add(scan, x, 3.1, z, SemanticClass::building, Motion::stationary);
    }
    add(scan, x, -3.1, 0.5, SemanticClass::car, Motion::semi_static);
    add(scan, x, -3.5, 0.5, SemanticClass::person, Motion::highly_dynamic);
  }
  for (double z = 0.1; z < 2.0; z += 0.2) {
    add(scan, 1.1, 1.1, z, SemanticClass::pole, Motion::stationary);
  }
  return scan;
}

}  // namespace

StaticMapConfig street_config() {
  StaticMapConfig config;
  config.tile_size_m = 4.0;
  return config;
}

SavedMap small_street() {
  StaticMap map(street_config());
  map.reset(77);
  const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(0.0, 0.0, lidar_height_m));
  for (int i = 0; i < 3; ++i) map.insert(street_scan(), T_map_lidar);
  static_cast<void>(map.view());
  SavedMap stored = to_saved_map(map.checkpoint(CheckpointScope::everything));
  for (int i = 0; i < 3; ++i) {
    stored.trajectory.push_back({1'700'000'000'000'000'000 + i * 100'000'000LL, T_map_lidar});
  }
  stored.metadata = {{"sensor", "VLP-16"}, {"software", "0"}};
  return stored;
}

}  // namespace stillmap::fuzz
