#pragma once

#include <filesystem>
#include <fstream>

#include "core/map/storage/map_file.hpp"

namespace stillmap::test {

/// Files that no command can put a drive or a map into: text.stillmap, empty.stillmap, and
/// coarse.stillmap, whose one voxel is of 0.4 m.
inline void write_unusable_maps(const std::filesystem::path& folder) {
  std::ofstream(folder / "text.stillmap") << "no map at all";
  open_map_file(folder / "empty.stillmap")->save(SavedMap{});
  StaticMapConfig config;
  config.voxel_size_m = 0.4;
  config.tile_size_m = 40.0;
  StaticMap coarse(config);
  LabelledScan scan;
  scan.scan.points_lidar.emplace_back(1.0F, 2.0F, 3.0F);
  scan.motion.push_back(Motion::stationary);
  coarse.insert(scan, Eigen::Isometry3d::Identity());
  open_map_file(folder / "coarse.stillmap")
      ->save(to_saved_map(coarse.checkpoint(CheckpointScope::everything)));
}

}  // namespace stillmap::test
