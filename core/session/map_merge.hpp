#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/lidar/labelled_scan.hpp"
#include "core/localization/place_index.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/session/map_alignment.hpp"

namespace stillmap {

/// What a lidar at this pose would see of these voxels of `voxel_size_m`, up to 40 m away: those
/// that no other one hides. All of it stands still.
[[nodiscard]] LabelledScan view_of_map(const std::vector<LabelledPoint>& points_map,
                                       const Eigen::Isometry3d& T_map_lidar, double voxel_size_m);

/// Where a map lies in another one, with no prior: what could be seen along its own path is put
/// onto the other map as a drive is. The poses are those of its path. Throws what the maps' tiles
/// throw.
[[nodiscard]] MapAlignment align_maps(const std::shared_ptr<const PlaceIndex>& map,
                                      const PlaceIndex& other, const SharedTrajectory& other_path,
                                      double voxel_size_m);

/// The tiles of `map` that `other` adds to, with the voxels of both, as a partial map to be saved
/// as another session: votes, points and counts of voxels at one place are added. Each voxel of
/// `other` moves with the pose of its path that saw it last, to `T_map_pose`; its stamps by
/// `clock_offset_ns`. The path is that of both. What one of the maps alone has stays: where the
/// other saw free space is in no map. Both have voxels and tiles of the same size. What of it is
/// shown `config` decides: no file keeps the rule that a map was made by.
[[nodiscard]] SavedMap merged_map(const SavedMap& map, const SavedMap& other,
                                  const std::vector<Eigen::Isometry3d>& T_map_pose,
                                  std::int64_t clock_offset_ns, StaticMapConfig config = {});

}  // namespace stillmap
