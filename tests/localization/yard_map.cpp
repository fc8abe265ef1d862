#include "tests/localization/yard_map.hpp"

#include <utility>
#include <vector>

#include "core/map/static_map.hpp"
#include "core/map/voxel_grid.hpp"

namespace stillmap::test {

simulation::SimulationConfig yard(std::uint64_t seed, std::uint64_t day) {
  simulation::SimulationConfig config;
  config.plan = simulation::test_yard();
  config.seed = seed;
  config.day = day;
  config.sensor = vlp_16();
  config.firings = 900;
  config.scans = 240;
  return config;
}

PointLabels labels_of(const Scan& scan) {
  return {scan.labels, std::vector<float>(scan.size(), 1.0F)};
}

namespace {

/// Between the two yards.
constexpr int tiles_apart = 40;

/// The yard of a day, mapped with true poses.
MappedYard mapped_yard(std::uint64_t seed) {
  StaticMapConfig map_config;
  map_config.min_points = 1;
  StaticMap map(map_config);
  const simulation::Simulation simulation(yard(seed, 0));
  MappedYard stored;
  for (int k = 0; k < simulation.config().scans; k += 4) {
    const simulation::SimulatedScan simulated = simulation.scan(k);
    LabelledScan labelled{simulated.scan, labels_of(simulated.scan), {}};
    for (const SemanticClass label : labelled.labels.classes)
      labelled.motion.push_back(is_movable(label) ? Motion::highly_dynamic : Motion::stationary);
    map.insert(labelled, simulated.T_map_lidar);
    stored.trajectory.push_back({simulated.stamp_ns, simulated.T_map_lidar});
  }
  stored.view = map.view();
  return stored;
}

}  // namespace

const MappedYard& first_yard() {
  static const MappedYard stored = mapped_yard(1);
  return stored;
}

std::shared_ptr<const PlaceIndex> index_of(const MappedYard& stored) {
  return std::make_shared<const PlaceIndex>(stored.view, stored.trajectory,
                                            std::make_shared<TileReader>());
}

double second_yard_m() { return tiles_apart * StaticMapConfig{}.tile_size_m; }

MappedYard yard_twice() {
  MappedYard twice = first_yard();
  // Whole tiles farther on: the same places again.
  std::vector<TileTable::SharedTile> tiles(twice.view->tiles.begin(), twice.view->tiles.end());
  const std::size_t count = tiles.size();
  const VoxelGrid grid(twice.view->voxel_size_m, twice.view->tile_size_m);
  const auto shift_m = static_cast<float>(second_yard_m());
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<Voxel> voxels(tiles[k]->voxels.begin(), tiles[k]->voxels.end());
    for (Voxel& voxel : voxels) voxel.mean_map.x() += shift_m;
    const TileId id{tiles[k]->info.id.x + tiles_apart, tiles[k]->info.id.y};
    tiles.push_back(std::make_shared<const Tile>(make_tile(id, 1, voxels, grid)));
  }
  MapSnapshot view = *twice.view;
  view.tiles = TileTable(std::move(tiles));
  twice.view = std::make_shared<const MapSnapshot>(std::move(view));
  for (std::size_t k = 0, poses = twice.trajectory.size(); k < poses; ++k) {
    StampedPose pose = twice.trajectory[k];
    pose.T_map_lidar.translation().x() += static_cast<double>(shift_m);
    twice.trajectory.push_back(pose);
  }
  return twice;
}

}  // namespace stillmap::test
