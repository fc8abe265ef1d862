#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/map/query/map_query.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

/// Merges voxels into larger cells, anchored at the map's origin: the position is the mean of the
/// means weighted by point count, the class the one with most evidence summed over the voxels.
class CoarseCells {
 public:
  /// `resolution_m` is not finer than the map's voxels. A voxel belongs to the cell that its mean
  /// lies in; the means of all lie in `bounds_map` [m]. `expected` cells have room at once; there
  /// may be more.
  CoarseCells(double resolution_m, const Eigen::AlignedBox3f& bounds_map, std::size_t expected);
  ~CoarseCells();
  CoarseCells(const CoarseCells&) = delete;
  CoarseCells& operator=(const CoarseCells&) = delete;

  void add(const Eigen::Vector3f& mean_map, std::uint32_t point_count,
           const ClassEvidence& evidence);

  /// All cells, in the order of x, then y, then z, whatever the order of adding.
  [[nodiscard]] std::vector<QueryVoxel> sorted() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
