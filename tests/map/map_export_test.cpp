#include "core/map/tools/map_export.hpp"

#include <gmock/gmock.h>

#include "core/dataset/dataset_error.hpp"
#include "core/dataset/point_cloud_files.hpp"
#include "tests/map/map_worlds.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

void expect_points_of(const MapSnapshot& view, const CloudFile& cloud) {
  std::size_t i = 0;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      ASSERT_LT(i, cloud.scan.size());
      EXPECT_EQ(cloud.scan.points_lidar[i], voxel.mean_map);
      EXPECT_EQ(cloud.raw_labels.at(i), semantic_kitti_id(voxel.evidence.winner()));
      ++i;
    }
  }
  EXPECT_EQ(i, cloud.scan.size());
}

TEST(MapExport, FilesHoldEveryVoxelWithItsClass) {
  const ScratchFolder folder;
  const auto view = test::street_map(1, 200).view();
  export_pcd(*view, folder / "map.pcd");
  expect_points_of(*view, read_point_cloud(folder / "map.pcd", 0));
  export_ply(*view, folder / "map.ply");
  expect_points_of(*view, read_point_cloud(folder / "map.ply", 0));
}

TEST(MapExport, FolderThatIsMissingIsNamed) {
  const ScratchFolder folder;
  EXPECT_THROW(export_ply(MapSnapshot{}, folder / "no" / "map.ply"), DatasetError);
}

}  // namespace
}  // namespace stillmap
