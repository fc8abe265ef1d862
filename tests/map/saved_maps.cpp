#include "tests/map/saved_maps.hpp"

#include "tests/map/map_worlds.hpp"

namespace stillmap::test {

SavedMap saved_map(int seed) {
  StaticMap map = street_map(1 + seed % 3, 60);
  LabelledScan landmark;
  for (int i = 0; i < 3; ++i) {
    add_point(landmark, {static_cast<float>(seed % 50), 0.0F, 5.0F}, SemanticClass::pole);
  }
  map.insert(landmark, Eigen::Isometry3d::Identity());
  SavedMap stored;
  stored.view = *map.view();
  stored.view.map_id = 0xFFFFFFFFFFFFFF00ULL + static_cast<std::uint64_t>(seed % 200);
  for (int i = 0; i < 5 + seed; ++i) {
    const Eigen::AngleAxisd turn(0.1 * i, Eigen::Vector3d(1, 2, 3).normalized());
    stored.trajectory.push_back({i * 100'000'000LL, Eigen::Translation3d(i, seed, 0.5) * turn});
  }
  stored.metadata = {{"sensor", "HDL-64E"}, {"seed", std::to_string(seed)}, {"empty", ""}};
  return stored;
}

void expect_equal(const SavedMap& a, const SavedMap& b) {
  EXPECT_EQ(a.view.version, b.view.version);
  EXPECT_EQ(a.view.map_id, b.view.map_id);
  EXPECT_EQ(a.view.tile_size_m, b.view.tile_size_m);
  EXPECT_EQ(a.view.voxel_size_m, b.view.voxel_size_m);
  EXPECT_EQ(a.metadata, b.metadata);
  ASSERT_EQ(a.view.tiles.size(), b.view.tiles.size());
  for (std::size_t i = 0; i < a.view.tiles.size(); ++i) {
    EXPECT_EQ(a.view.tiles[i]->info.id, b.view.tiles[i]->info.id);
    EXPECT_EQ(a.view.tiles[i]->info.revision, b.view.tiles[i]->info.revision);
    EXPECT_EQ(a.view.tiles[i]->info.content_hash, b.view.tiles[i]->info.content_hash);
    EXPECT_EQ(a.view.tiles[i]->voxels.size(), b.view.tiles[i]->voxels.size());
  }
  ASSERT_EQ(a.trajectory.size(), b.trajectory.size());
  for (std::size_t i = 0; i < a.trajectory.size(); ++i) {
    EXPECT_EQ(a.trajectory[i].stamp_ns, b.trajectory[i].stamp_ns);
    EXPECT_TRUE(a.trajectory[i].T_map_lidar.isApprox(b.trajectory[i].T_map_lidar, 1e-12));
  }
}

}  // namespace stillmap::test
