#include "core/map/tile_evidence.hpp"

#include "core/map/voxel_grid.hpp"

namespace stillmap {

std::vector<RemovedVoxel> removed_voxels(const TileEvidence& evidence, double voxel_size_m,
                                         double tile_size_m) {
  const VoxelGrid grid(voxel_size_m, tile_size_m);
  std::vector<RemovedVoxel> removed;
  for (std::size_t i = 0; i < evidence.hidden.size(); ++i) {
    const auto reason = evidence.hidden_states[i].reason;
    if (!reason) continue;
    const Voxel voxel = evidence.hidden[i];
    removed.push_back({voxel.mean_map, voxel.evidence.winner(), *reason, voxel.last_seen_ns});
  }
  for (const ExcludedVoxel& voxel : evidence.excluded) {
    const Eigen::Vector3d centre =
        grid.corner_map(evidence.id, voxel.index).array() + 0.5 * voxel_size_m;
    removed.push_back({centre.cast<float>(), voxel.label,
                       voxel.was_moving ? RemovalReason::moving : RemovalReason::semi_static,
                       voxel.last_seen_ns});
  }
  return removed;
}

}  // namespace stillmap
