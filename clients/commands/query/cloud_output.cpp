#include "clients/commands/query/cloud_output.hpp"

#include "core/dataset/point_cloud_files.hpp"

namespace stillmap::cli {

bool is_cloud_file(const std::string& file) {
  return file.ends_with(".pcd") || file.ends_with(".ply");
}

void write_cloud(const std::string& file, const std::vector<QueryVoxel>& voxels) {
  std::vector<ColouredPoint> points;
  points.reserve(voxels.size());
  for (const QueryVoxel& voxel : voxels) {
    points.push_back({voxel.position_map, voxel.label, voxel.confidence});
  }
  file.ends_with(".pcd") ? write_pcd(file, points) : write_ply(file, points);
}

}  // namespace stillmap::cli
