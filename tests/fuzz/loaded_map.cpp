#include "tests/fuzz/loaded_map.hpp"

#include <stdexcept>

#include "core/map/query/map_query.hpp"
#include "core/occupancy/occupancy_map.hpp"
#include "core/traversability/traversability_map.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
namespace {

RobotProfile small_robot() {
  RobotProfile robot;
  robot.name = "robot";
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::road)) = 0.1;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::unlabeled)) = 0.3;
  return robot;
}

/// A point in every tile, and one at the origin.
LabelledScan touching_scan(const MapSnapshot& view) {
  LabelledScan scan;
  const auto add = [&](const Eigen::Vector3f& p_map) {
    scan.scan.points_lidar.push_back(p_map);
    scan.labels.classes.push_back(SemanticClass::road);
    scan.labels.confidence.push_back(1.0F);
    scan.motion.push_back(Motion::stationary);
  };
  add(Eigen::Vector3f::Zero());
  for (const auto& tile : view.tiles) {
    if (!tile->voxels.empty()) add(tile->voxels.front().mean_map);
  }
  return scan;
}

void resume(const SavedMap& stored) {
  StaticMap map(street_config());
  map.resume(stored.view, stored.tile_evidence);
  const Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();
  map.insert(touching_scan(stored.view), origin);
  const Eigen::AlignedBox3d box_map(Eigen::Vector3d(-5, -5, -5), Eigen::Vector3d(5, 5, 5));
  static_cast<void>(map.removed(box_map, map.tiles_in(box_map)));
  static_cast<void>(map.restore_removed(RemovalReason::moving, box_map, map.tiles_in(box_map)));
  const auto view = map.view();
  static_cast<void>(query_map(*view, MapQuery{}));
  MapQuery coarse;
  coarse.resolution_m = 1.0;
  static_cast<void>(query_map(*view, coarse));
  OccupancyMap octree{OccupancyConfig{}};
  octree.insert(*view);
  TraversabilityMap areas({small_robot()});
  static_cast<void>(areas.update(*view));
}

}  // namespace

void load_and_resume_map(const std::filesystem::path& file) {
  SavedMap stored;
  try {
    const auto store = open_map_file(file);
    stored = store->load();
    static_cast<void>(store->load_non_resident());
  } catch (const MapFileError&) {
    return;
  }
  try {
    resume(stored);
  } catch (const std::invalid_argument&) {
  }
}

}  // namespace stillmap::fuzz
