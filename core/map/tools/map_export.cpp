#include "core/map/tools/map_export.hpp"

#include <vector>

#include "core/dataset/point_cloud_files.hpp"

namespace stillmap {
namespace {

std::vector<ColouredPoint> points_of(const MapSnapshot& view) {
  std::vector<ColouredPoint> points;
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      points.push_back({voxel.mean_map, voxel.evidence.winner(), voxel.evidence.share()});
    }
  }
  return points;
}

}  // namespace

void export_pcd(const MapSnapshot& view, const std::filesystem::path& file) {
  write_pcd(file, points_of(view));
}

void export_ply(const MapSnapshot& view, const std::filesystem::path& file) {
  write_ply(file, points_of(view));
}

}  // namespace stillmap
