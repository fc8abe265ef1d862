#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "core/lidar/semantic_class.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

struct MapDiffOptions {
  /// Two voxels may be the same surface when they are at most so many cells apart along each axis:
  /// noise moves a surface across a cell's border. 0 to `max_tolerance_voxels`.
  int tolerance_voxels = 1;

  static constexpr int max_tolerance_voxels = 5;
};

enum class VoxelChange : std::uint8_t {
  /// In the later map, and no voxel of the earlier one is near.
  appeared,
  /// In the earlier map, and no voxel of the later one is near.
  gone,
  /// In the earlier map; the later one has voxels near, none of this class.
  relabelled,
};

struct VoxelDifference {
  VoxelChange change = VoxelChange::appeared;
  /// In its own map, map frame [m].
  Eigen::Vector3f position_map = Eigen::Vector3f::Zero();
  /// `unlabeled` for what appeared.
  SemanticClass before = SemanticClass::unlabeled;
  /// Of what was relabelled: of the nearest voxel of the later map. `unlabeled` for what is gone.
  SemanticClass after = SemanticClass::unlabeled;
};

struct DifferenceCounts {
  std::uint64_t appeared = 0;
  std::uint64_t gone = 0;
  std::uint64_t relabelled = 0;

  [[nodiscard]] std::uint64_t sum() const { return appeared + gone + relabelled; }
  void add(VoxelChange change);
  friend bool operator==(const DifferenceCounts&, const DifferenceCounts&) = default;
};

/// What a class had in each map. `relabelled` counts voxels that had the class before.
struct ClassDifference {
  std::uint64_t voxels_before = 0;
  std::uint64_t voxels_after = 0;
  DifferenceCounts counts;
};

struct TileDifference {
  TileId id;
  DifferenceCounts counts;
};

/// What changed from one map to another in the same frame.
struct MapDiff {
  DifferenceCounts counts;
  std::array<ClassDifference, semantic_class_count> classes;
  /// Voxels that went from the first class to the second.
  std::map<std::pair<SemanticClass, SemanticClass>, std::uint64_t> relabelled;
  /// Tiles in which something changed, sorted by id.
  std::vector<TileDifference> tiles;
  /// Of the earlier map first, each in the order of tiles and voxels.
  std::vector<VoxelDifference> voxels;
};

/// Compares voxel by voxel. Throws std::invalid_argument for maps with voxels or tiles of different
/// sizes, or a tolerance that is not allowed.
[[nodiscard]] MapDiff diff_maps(const MapSnapshot& before, const MapSnapshot& after,
                                const MapDiffOptions& options = {});

}  // namespace stillmap
