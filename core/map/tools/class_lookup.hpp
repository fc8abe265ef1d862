#pragma once

#include <memory>
#include <optional>

#include "core/map/tile.hpp"

namespace stillmap {

/// What stands near a cell.
struct NearClasses {
  /// A voxel of the class asked for is within reach.
  bool has_same = false;
  /// Class of the nearest voxel within reach, of equally near ones the first by index; not looked
  /// for when `has_same`.
  std::optional<SemanticClass> nearest;
};

/// The classes of a map's voxels by cell, across the borders of tiles.
class ClassLookup {
 public:
  /// Of `view`, for questions about cells of `asking`, which has tiles and voxels of the same size
  /// unless one of them is empty.
  ClassLookup(const MapSnapshot& view, const MapSnapshot& asking);
  ~ClassLookup();
  ClassLookup(const ClassLookup&) = delete;
  ClassLookup& operator=(const ClassLookup&) = delete;

  /// Looks at all cells at most `reach` cells away along each axis. Thread-safe.
  [[nodiscard]] NearClasses near(TileId tile, VoxelIndex index, SemanticClass label,
                                 int reach) const;

 private:
  struct Cells;
  std::unique_ptr<const Cells> cells_;
};

}  // namespace stillmap
